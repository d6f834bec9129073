"""Presets: explicit parameters win, some steps alone can be taken, and nothing of them is left in the document."""

import pytest

from pipelines.archive.settings import changed_parameters, set_names
from schemas.base.errors import RefusedInput
from schemas.base.json_files import validate
from schemas.parameters.presets import THESIS
from schemas.parameters.scan import ScanParameters
from schemas.parameters.surface import SurfaceParameters

DEFAULTS = ScanParameters()


def test_all_steps_of_the_thesis() -> None:
    parameters = validate("workflow.yaml", ScanParameters, {"preset": "thesis"})

    for section, values in THESIS.items():
        for name, value in values.items():
            assert getattr(getattr(parameters, section), name) == (tuple(value) if isinstance(value, list) else value)
    assert parameters.normals == DEFAULTS.normals
    assert "preset" not in parameters.model_dump()
    assert validate("again", ScanParameters, parameters.model_dump(mode="json")) == parameters


@pytest.mark.parametrize("step", list(THESIS))
def test_one_step_alone_leaves_the_others_as_they_are(step: str) -> None:
    parameters = ScanParameters(preset=f"thesis:{step}")

    changed = [name for name in DEFAULTS.model_dump() if getattr(parameters, name) != getattr(DEFAULTS, name)]
    assert changed == [step]


@pytest.mark.parametrize("surface", [{"method": "closed"}, SurfaceParameters(method="closed")], ids=["file", "model"])
def test_what_a_file_says_wins(surface: object) -> None:
    parameters = ScanParameters.model_validate({"preset": "thesis", "surface": surface})

    assert parameters.surface.method == "closed"
    assert parameters.outliers.method == "levels"


@pytest.mark.parametrize("preset", ["theses", "thesis:", "thesis:mesh", "thesis:surface,", "thesis:surface,mesh", ""])
def test_an_unknown_preset_is_refused_by_name(preset: str) -> None:
    with pytest.raises(RefusedInput, match="preset"):
        validate("workflow.yaml", ScanParameters, {"preset": preset})
    with pytest.raises(RefusedInput, match="--set: preset"):
        changed_parameters(DEFAULTS, [f"preset={preset}"])


def test_on_the_command_line_a_preset_wins_over_the_file_and_single_settings_over_it() -> None:
    of_file = validate("workflow.yaml", ScanParameters, {"extraction": {"red_threshold": 18, "gap_px": 7}})

    changed = changed_parameters(of_file, ["surface.method=closed", "preset=thesis"])

    assert changed.extraction.red_threshold == THESIS["extraction"]["red_threshold"]
    assert changed.extraction.gap_px == 7
    assert changed.surface.method == "closed"
    assert {"extraction.stripe", "outliers.z_mm", "surface.method"} <= set_names(
        ["surface.method=closed", "preset=thesis"]
    )

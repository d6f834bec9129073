"""What is wrong with a scan is corrected, or makes its measures uncertain: none is `ok` and wrong."""

from pathlib import Path

import pytest

from footscan.virtual.worlds.draw import as_designed, draw_assembled
from footscan.virtual.worlds.faults import FAULTS, with_fault
from pipelines.engine.pool import Threads
from pipelines.worlds.campaign import run_worlds
from schemas.campaign import WorldOutcome
from schemas.parameters.scan import ScanParameters

MEASURED = ("glass 1.5 mm higher", "none", "cameras 5, 6 missing", "foot trembles")
"""Faults with which measures are still right, each on a foot of its own; all but the first with the slow tests."""


def outcome_of(name: str, seed: int, folder: Path) -> WorldOutcome:
    world = with_fault(as_designed(draw_assembled(seed)), FAULTS[name])
    [outcome] = run_worlds([world], "points", ScanParameters(), folder, Threads(2), lambda _: None)
    return outcome


@pytest.mark.parametrize(
    ("name", "seed"),
    [pytest.param(name, 611 + k, marks=[pytest.mark.slow] if k else []) for k, name in enumerate(MEASURED)],
)
def test_a_scan_with_a_fault_that_can_be_corrected_is_measured(name: str, seed: int, tmp_path: Path) -> None:
    outcome = outcome_of(name, seed, tmp_path)
    assert not outcome.silent_errors
    for measure in ("foot_length", "foot_breadth"):
        found = outcome.measures[measure]
        assert found.status == "ok"
        assert found.error == pytest.approx(0.0, abs=0.5)


@pytest.mark.slow
def test_a_foot_that_has_moved_between_the_passes_is_not_trusted(tmp_path: Path) -> None:
    outcome = outcome_of("foot moved along", 615, tmp_path)
    assert "ok" not in {measure.status for measure in outcome.measures.values()}
    assert "points of a head lie" in " ".join(outcome.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in FAULTS if name not in ("foot sways", "steps of 4 mm")])
def test_no_fault_goes_unnoticed(name: str, tmp_path: Path) -> None:
    assert not outcome_of(name, 616, tmp_path).silent_errors

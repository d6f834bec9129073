"""Every value of every choice among the parameters works from films to measures."""

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from enum import Enum
from itertools import chain
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import numpy as np
import pytest
from pydantic import BaseModel

from footscan.calibration.models.maps import to_world
from pipelines.archive.job import job_of_workflow
from pipelines.archive.planning import plan_job
from pipelines.archive.running import run_job
from pipelines.cli.main import run_command
from pipelines.engine.pool import Threads
from pipelines.recordings.calibration_choice import CalibrationPlace
from schemas.base.overrides import overridden
from schemas.calibration import Calibration
from schemas.measures import Measures
from schemas.parameters.calibration import CalibrationParameters
from schemas.parameters.scan import ScanParameters

Choice = tuple[str, object]
"""A parameter as `--set` names it, and one of its values."""


def choices(model: type[BaseModel], section: str = "") -> Iterator[Choice]:
    """Every value but the default of each parameter that takes one of a few, in `model` and in what it holds."""
    for name, field in model.model_fields.items():
        annotation = field.annotation
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield from choices(annotation, f"{section}{name}.")
        else:
            yield from ((f"{section}{name}", value) for value in _values(annotation) if value != field.default)


def _values(annotation: Any) -> list[object]:
    """The values of a choice, also of one within a union; none of what is no choice."""
    if annotation is bool:
        return [False, True]
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return [member.value for member in annotation]
    if get_origin(annotation) is Literal:
        return list(get_args(annotation))
    return list(chain.from_iterable(map(_values, get_args(annotation))))


OTHER_LASERS = [("extraction.laser", "green"), ("extraction.laser", "blue")]
"""The archive's films have a red one."""
STEP_MM = 10.0
"""From frame to frame of the archive's films: heel and toes are known no better."""
CHOICES = [choice for choice in choices(ScanParameters) if choice not in OTHER_LASERS]


def test_choices_are_found_wherever_they_stand() -> None:
    class Colour(Enum):
        RED = "red"
        BLUE = "blue"

    class Inner(BaseModel):
        colour: Colour = Colour.RED
        size: Literal["small", "large"] | None = None
        length_mm: float = 1.0

    class Outer(BaseModel):
        inner: Inner = Inner()
        fast: bool = True

    found = [("inner.colour", "red"), ("inner.colour", "blue"), ("inner.size", "small"), ("inner.size", "large")]
    assert list(choices(Outer)) == [*found, ("fast", False)]
    assert ("surface.method", "ball_pivoting") in CHOICES


@pytest.fixture(scope="module")
def bench(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive after a run by the defaults; each choice adds to its cache, and has results of its own."""
    return Path(shutil.copytree(finished, tmp_path_factory.mktemp("choices") / "home"))


@pytest.mark.parametrize(("name", "value"), CHOICES)
def test_every_choice_runs_from_films_to_measures(bench: Path, tmp_path: Path, name: str, value: object) -> None:
    results = run(bench, tmp_path, f"{name}={value}")
    assert {file.name for file in results.iterdir()} == {
        "cloud.ply", "foot.stl", "foot.ply", "measures.json", "sizes.json", "quality.json",
        "report.html"
    }  # fmt: skip
    measures = Measures.model_validate_json((results / "measures.json").read_bytes())
    assert measures.finding is None
    assert length_mm(results) == pytest.approx(length_mm(bench / "results/P0001/S1"), abs=STEP_MM)


@pytest.mark.parametrize(("name", "value"), list(choices(CalibrationParameters)))
def test_every_choice_of_a_calibration_leads_to_measures(
    bench: Path, tmp_path: Path, calibration: Callable[[], Calibration], name: str, value: object
) -> None:
    chart, made = tmp_path / "chart.csv", tmp_path / "calibration.json"
    chart.write_text(chart_of(calibration()))
    assert run_command(["calibrate", "chart", str(chart), f"--{name}", str(value), "--out", str(made)]) == 0
    results = run(bench, tmp_path / "results", calibration=made)
    assert length_mm(results) == pytest.approx(length_mm(bench / "results/P0001/S1"), abs=STEP_MM)


def chart_of(calibration: Calibration) -> str:
    """Control points all over the pictures, by the maps of a calibration."""
    lines = ["camera,point,x_mm,y_mm,z_mm,i,j"]
    pixels = np.stack(np.meshgrid(np.arange(40.0, 620.0, 60.0), np.arange(40.0, 460.0, 60.0)), axis=-1).reshape(-1, 2)
    for camera in calibration.cameras:
        for number, ((i, j), (y, z)) in enumerate(zip(pixels, to_world(camera, pixels), strict=True)):
            lines.append(f"{camera.camera},P{number},0,{y:.4f},{z:.4f},{i},{j}")
    return "\n".join(lines) + "\n"


def length_mm(results: Path) -> float | None:
    return Measures.model_validate_json((results / "measures.json").read_bytes()).measures["foot_length"].value


def run(bench: Path, results: Path, *settings: str, calibration: Path | None = None) -> Path:
    """The results of the archive's scan, run with `settings` as `--set` takes them, by the archive's own cache."""
    job = job_of_workflow(bench / "workflow.yaml")
    parameters = overridden(ScanParameters, job.parameters.model_dump(mode="json"), settings)
    places = job.calibrations if calibration is None else (CalibrationPlace(calibration),)
    changed = replace(job, parameters=parameters, calibrations=places)
    planned = plan_job(replace(changed, results=results, cache=bench / "results/.footscan"))
    [end] = run_job(planned, Threads(2), lambda _: None)
    assert (end.scan, end.problem) == ("P0001/S1", None)
    assert end.folder is not None
    return end.folder

"""What every virtual recording needs beside its scan: a calibration of the virtual scanner, and its results by kind."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from pipelines.engine.actions.step import Failure, Outcome, Output, Step
from pipelines.scan import STEPS
from schemas.base.errors import Fault
from schemas.parameters.calibration import CaptureCalibrationParameters
from schemas.parameters.simulation import SimulationSettings


def calibration_steps(name: str, capture: Path, settings: SimulationSettings) -> list[Step]:
    """Film the reference object into the folder `capture`, and calibrate from it: steps of `name`, kinds `capture` and
    `calibrate`."""
    film_capture = Step(
        name, "capture", f"{STEPS}.simulate_capture", settings,
        places={"folder": capture}, writes=capture / "capture.yaml",
    )  # fmt: skip
    calibrate = Step(
        name, "calibrate", f"{STEPS}.calibrate_capture", CaptureCalibrationParameters(),
        {"capture": Output(film_capture.name)}, places={"capture": capture},
    )  # fmt: skip
    return [film_capture, calibrate]


def digests_of(steps: Iterable[Step], outcomes: Mapping[str, Outcome]) -> dict[str, str]:
    """What each of `steps` came to, by its kind; Fault where one failed."""
    digests: dict[str, str] = {}
    for step in steps:
        outcome = outcomes[step.name]
        if isinstance(outcome, Failure):
            raise Fault(f"{step.name}: {outcome.problem}")
        digests[step.kind] = outcome.digest
    return digests

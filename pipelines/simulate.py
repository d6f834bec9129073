"""What every virtual recording needs beside its scan: a calibration of the virtual scanner."""

from pathlib import Path

from pipelines.engine.actions.step import Output, Step
from pipelines.scan import STEPS
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

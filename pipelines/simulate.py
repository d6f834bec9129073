"""What every virtual recording needs beside its scan: a calibration of the virtual scanner."""

from pathlib import Path

from pipelines.calibrate import CaptureInputs, calibration_steps
from pipelines.engine.actions.step import Output, Step, Value
from pipelines.recordings.captures import CAPTURE_FILE
from pipelines.scan import STEPS
from schemas.parameters.calibration import CaptureCalibrationParameters
from schemas.parameters.simulation import SimulationSettings


def filmed_calibration_steps(name: str, capture: Path, settings: SimulationSettings) -> list[Step]:
    """Film the reference object into the folder `capture`, and calibrate from it: steps of `name`, of kind `capture`
    the first and `calibrate` the last."""
    film_capture = Step(
        name, "capture", f"{STEPS}.simulate_capture", settings,
        places={"folder": capture}, writes=capture / CAPTURE_FILE,
    )  # fmt: skip
    filmed = _filmed_inputs(capture, Output(film_capture.name))
    return [film_capture, *calibration_steps(name, filmed, CaptureCalibrationParameters())]


def _filmed_inputs(folder: Path, listing: Output) -> CaptureInputs:
    """What the steps take of a capture that the virtual scanner is to film."""
    from footscan.virtual.filming.capture import capture_document
    from pipelines.steps.simulate_capture import filmed_reference

    document = capture_document()
    names = {camera.id: camera.file for camera in document.cameras}
    return CaptureInputs(
        folder / CAPTURE_FILE,
        document,
        filmed_reference(),
        {camera: folder / name for camera, name in names.items()},
        {camera: {"film": listing, "file": Value(name.encode())} for camera, name in names.items()},
        [CAPTURE_FILE, document.reference, *names.values()],
        listing,
    )

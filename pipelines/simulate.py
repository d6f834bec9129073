"""The steps that calibrate the virtual scanner from a simulated capture."""

from pathlib import Path

from pipelines.calibrate import CaptureInputs, calibration_steps
from pipelines.engine.actions.step import Output, Step, Value
from pipelines.recordings.captures import CAPTURE_FILE
from pipelines.scan import STEPS
from schemas.parameters.calibration import CaptureCalibrationParameters
from schemas.parameters.simulation import SimulationSettings


def filmed_calibration_steps(name: str, capture: Path, settings: SimulationSettings) -> list[Step]:
    """Build the steps that film the reference object into the folder `capture` and calibrate from it.

    `name` is the name of the graph's scan. The first step is of kind `capture`, the last of kind `calibrate`.
    """
    film_capture = Step(
        name, "capture", f"{STEPS}.simulate_capture", settings,
        places={"folder": capture}, writes=capture / CAPTURE_FILE,
    )  # fmt: skip
    filmed = _filmed_inputs(capture, Output(film_capture.name))
    return [film_capture, *calibration_steps(name, filmed, CaptureCalibrationParameters())]


def _filmed_inputs(folder: Path, listing: Output) -> CaptureInputs:
    """The inputs of the steps from a capture that the virtual scanner will film."""
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

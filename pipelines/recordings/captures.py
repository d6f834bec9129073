"""Calibration captures: reading one and checking it against its capture.yaml."""

from dataclasses import dataclass
from pathlib import Path

from footscan.frames.film import film_files, open_camera_film
from footscan.recordings.film_paths import film_inside
from footscan.recordings.scans import recorded_folder
from schemas.base.errors import RefusedInput
from schemas.base.paths import inside
from schemas.base.yaml_files import read_yaml
from schemas.mounting import CaptureCamera
from schemas.reference import Capture, ReferenceObject

CAPTURE_FILE = "capture.yaml"


@dataclass(frozen=True)
class RecordedCapture:
    """A capture folder that follows its format; no path in capture.yaml may leave it."""

    folder: Path
    document: Capture
    reference: ReferenceObject
    """Frame k of each camera shows its placement k."""

    @property
    def file(self) -> Path:
        """The capture.yaml of the capture."""
        return self.folder / CAPTURE_FILE

    @property
    def reference_file(self) -> Path:
        """The reference object's document."""
        return _reference_file(self.folder, self.document)

    @property
    def files(self) -> list[Path]:
        """All files of the capture that are read."""
        films = [file for camera in self.document.cameras for file in film_files(self.film(camera))]
        return [self.file, self.reference_file, *films]

    def film(self, camera: CaptureCamera) -> Path:
        """The film of a camera."""
        return film_inside(self.folder, self.file, camera.file, f"file of camera {camera.id}")


def read_capture(folder: Path) -> RecordedCapture:
    """The capture in `folder`, each of its films opened and counted.

    Raises
    ------
    RefusedInput
        The capture.yaml or the reference object is missing or breaks its format; or a film is missing, is not a film,
        or does not have one frame for each placement.
    """
    folder = recorded_folder(folder, CAPTURE_FILE, "a calibration capture")
    document = read_yaml(folder / CAPTURE_FILE, Capture)
    reference = read_yaml(_reference_file(folder, document), ReferenceObject)
    capture = RecordedCapture(folder, document, reference)
    films = [capture.film(camera) for camera in document.cameras]  # all refused before any is opened
    placements = len(reference.placements_mm)
    for film in films:
        frames = open_camera_film(film).count
        if frames != placements:
            expected = f"expected {placements}, one for each placement of {capture.reference_file.name}"
            raise RefusedInput(film, f"{frames} frame{'s' * (frames != 1)}, {expected}")
    return capture


def _reference_file(folder: Path, document: Capture) -> Path:
    return inside(folder, folder / CAPTURE_FILE, document.reference, "reference")

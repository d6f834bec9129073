"""The frames of a session on the disk, placement by placement, until they are a capture.

A folder without capture.yaml is a session that was interrupted: it can be gone on with.
"""

import datetime
import shutil
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import yaml

from pipelines.engine.files.atomic import write_atomically
from pipelines.recordings.captures import CAPTURE_FILE
from schemas.base.errors import Fault, FootscanError
from schemas.base.model import Document
from schemas.base.yaml_files import read_yaml
from schemas.mounting import CaptureCamera
from schemas.reference import Capture, ReferenceObject

Purpose = Literal["calibration", "check"]
REFERENCE_FILE = "reference.yaml"
SESSION_FILE = "session.yaml"
"""The reference object with all its placements; `REFERENCE_FILE` has those that were filmed, once the session ends."""


@dataclass(frozen=True)
class FilmedPlacements:
    """The folder of a session."""

    folder: Path
    reference: ReferenceObject
    cameras: tuple[int, ...]

    @property
    def numbers(self) -> tuple[int, ...]:
        """The placements of which each camera has its frame."""
        placements = range(len(self.reference.placements_mm))
        return tuple(n for n in placements if all(self._frame(camera, n).is_file() for camera in self.cameras))

    def keep(self, number: int, frames: Mapping[int, bytes]) -> None:
        """Write the JPEG of each camera in a placement, and the reference object if it is not there yet."""
        if not (self.folder / SESSION_FILE).exists():
            write_document(self.folder / SESSION_FILE, self.reference)
        self.drop(number)
        for camera in self.cameras:
            write_atomically(self._frame(camera, number), frames[camera])

    def drop(self, number: int) -> None:
        """Remove the frames of a placement."""
        for camera in self.cameras:
            self._frame(camera, number).unlink(missing_ok=True)

    def frames(self, number: int) -> dict[int, bytes]:
        """The JPEG of each camera in a placement."""
        return {camera: self._frame(camera, number).read_bytes() for camera in self.cameras}

    def finish(self, x_mm: float) -> None:
        """Make a capture of the placements that are filmed; `x_mm`: of the laser plane."""
        taken = set(self.numbers)
        for number in set(range(len(self.reference.placements_mm))) - taken:
            self.drop(number)  # frames of some cameras alone
        placements = [self.reference.placements_mm[number] for number in sorted(taken)]
        filmed = self.reference.model_copy(update={"placements_mm": placements})
        cameras = [CaptureCamera(id=camera, file=f"cam{camera}/") for camera in self.cameras]
        capture = Capture(format="footscan.capture/1", reference=REFERENCE_FILE, x_mm=x_mm, cameras=cameras)
        write_document(self.folder / REFERENCE_FILE, filmed)
        write_document(self.folder / CAPTURE_FILE, capture)  # last: nothing without it is a capture

    def reopen(self) -> None:
        """Take the capture back: more placements can be filmed."""
        (self.folder / CAPTURE_FILE).unlink(missing_ok=True)

    def discard(self) -> None:
        """Remove the folder."""
        try:
            if self.folder.exists():
                shutil.rmtree(self.folder)
        except OSError as error:
            raise Fault(f"{self.folder}: cannot be removed ({error.strerror or error})") from None

    def _frame(self, camera: int, number: int) -> Path:
        return self.folder / f"cam{camera}" / f"{number:03d}.jpg"


def new_session(
    captures: Path, scanner: str, purpose: Purpose, reference: ReferenceObject, cameras: Collection[int]
) -> FilmedPlacements:
    """A session of today in a folder that does not exist yet, such as `captures/S1-calibration-2026-11-24`."""
    today = datetime.datetime.now().astimezone().date().isoformat()
    first = f"{scanner}-{purpose}-{today}"
    names = [first, *(f"{first}-{number}" for number in range(2, len(_folders(captures)) + 3))]
    folder = next(captures / name for name in names if not (captures / name).exists())
    return FilmedPlacements(folder, reference, tuple(sorted(cameras)))


def interrupted_session(
    captures: Path, scanner: str, purpose: Purpose, reference: ReferenceObject, cameras: Collection[int]
) -> FilmedPlacements | None:
    """The latest session with this reference object that was not finished; None without one."""
    prefix = f"{scanner}-{purpose}-"
    folders = [folder for folder in _folders(captures) if folder.name.startswith(prefix)]
    for folder in sorted(folders, key=lambda folder: folder.stat().st_mtime, reverse=True):
        if (folder / CAPTURE_FILE).exists() or not (folder / SESSION_FILE).exists():
            continue
        try:
            filmed = read_yaml(folder / SESSION_FILE, ReferenceObject)
        except FootscanError:
            continue  # another program's, or damaged: it stays as it is
        session = FilmedPlacements(folder, reference, tuple(sorted(cameras)))
        if filmed == reference and session.numbers:
            return session
    return None


def write_document(path: Path, document: Document) -> None:
    """Write a YAML document."""
    text = yaml.safe_dump(document.model_dump(mode="json", exclude_none=True), sort_keys=False, default_flow_style=None)
    write_atomically(path, text.encode())


def _folders(captures: Path) -> list[Path]:
    return [folder for folder in captures.iterdir() if folder.is_dir()] if captures.is_dir() else []

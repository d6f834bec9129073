"""Recorded scans: finding them in an archive and checking what their scan.yaml promises."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from footscan.recordings.film_paths import film_inside
from schemas.base.errors import RefusedInput
from schemas.base.paths import inside
from schemas.base.yaml_files import read_yaml
from schemas.frames import GROUP
from schemas.scan import CameraFilm, Scan

SCAN_FILE, RECORDING_FILE = "scan.yaml", "recording.json"


@dataclass(frozen=True)
class RecordedScan:
    """A scan folder that follows its format."""

    folder: Path
    archive: Path
    """No path in scan.yaml may leave it."""
    document: Scan
    frames: Path | None = None
    """Folder for the frames of its films; default: beside the films."""
    _found: dict[str, Path] = field(default_factory=dict, compare=False, repr=False)
    """Where the paths in scan.yaml lead: each is followed once."""
    _films: dict[str, Path] = field(default_factory=dict, compare=False, repr=False)
    """Likewise, of films and arrays of frames."""

    @property
    def name(self) -> str:
        """`patient/scan`: its place in the results."""
        return f"{self.document.patient}/{self.document.scan}"

    @property
    def file(self) -> Path:
        """Its scan.yaml."""
        return self.folder / SCAN_FILE

    def film(self, camera: CameraFilm) -> Path:
        """The film of a camera, which may be missing."""
        return self._film(camera.file, f"file of camera {camera.id}")

    def arrays(self) -> Path:
        """The Zarr group of all cameras' frames, which may not be there yet."""
        return self._film(GROUP, "frames") if self.frames is None else self.frames / GROUP

    def array(self, camera: CameraFilm) -> Path:
        """The Zarr array of a camera's frames, which may not be there yet."""
        return self._array(f"cam{camera.id}", camera.file, f"frames of camera {camera.id}")

    def background(self, camera: CameraFilm) -> Path | None:
        """The film of a camera with the laser off, which may be missing."""
        named = camera.background
        return None if named is None else self._film(named, f"background of camera {camera.id}")

    def background_array(self, camera: CameraFilm) -> Path:
        """The Zarr array of a camera's laser-off frames, which may not be there yet."""
        name = f"cam{camera.id}-background"
        return self._array(name, camera.background, f"background frames of camera {camera.id}")

    def positions(self, camera: CameraFilm) -> Path | None:
        """The file with the positions of a camera's frames."""
        return self._optional(camera.positions, f"positions of camera {camera.id}")

    @property
    def calibration(self) -> Path | None:
        """The calibration that the scan names."""
        return self._optional(self.document.calibration, "calibration")

    @property
    def calibration_check(self) -> Path | None:
        """The check of its calibration that the scan carries."""
        return self._optional(self.document.calibration_check, "calibration_check")

    @property
    def truth(self) -> Path | None:
        """The reference model that the scan names."""
        return self._optional(self.document.truth, "truth")

    @property
    def recording(self) -> Path | None:
        """How it was filmed, its recording.json; None for a scan of another program."""
        file = self._inside(RECORDING_FILE, "recording")
        return file if file.is_file() else None

    def _optional(self, named: str | None, field: str) -> Path | None:
        return None if named is None else self._inside(named, field)

    def _array(self, name: str, film: str | None, field: str) -> Path:
        """The array of a film; a scan that was filmed into its arrays has them nowhere else."""
        named = f"{GROUP}/{name}"
        return self._film(named, field) if self.frames is None or film == named else self.frames / named

    def _film(self, named: str, field: str) -> Path:
        """As `_inside`; what lies in a folder of frames is looked at, too."""
        if named not in self._films:
            self._films[named] = film_inside(self.archive, self.file, named, field)
        return self._films[named]

    def _inside(self, named: str, field: str) -> Path:
        if named not in self._found:
            self._found[named] = inside(self.archive, self.file, named, field)
        return self._found[named]


def read_scan(folder: Path, archive: Path | None = None) -> RecordedScan:
    """The scan in `folder`; without an archive, that is the folder above the patient's.

    Raises
    ------
    RefusedInput
        No scan.yaml, or one that breaks its format.
    """
    folder = recorded_folder(folder, SCAN_FILE, "a recorded scan")
    scan = RecordedScan(folder, (archive or folder.parent.parent).resolve(), read_yaml(folder / SCAN_FILE, Scan))
    scan.arrays()
    for camera in scan.document.cameras:
        scan.film(camera)  # refused here, before any work, where they leave the archive
        scan.array(camera)
        if scan.background(camera) is not None:
            scan.background_array(camera)
        scan.positions(camera)
    return scan


def recorded_folder(folder: Path, file: str, what: str) -> Path:
    """`folder`, resolved; a refusal where it is none and so cannot hold `file`, the document of `what`."""
    if folder.is_file():
        raise RefusedInput(folder, f"is a file, expected the folder that holds {file}")
    if not folder.is_dir():
        raise RefusedInput(folder, f"no such folder, expected {what}")
    return folder.resolve()


def scan_folders(archive: Path) -> Iterator[Path]:
    """The folders below `archive` that hold a scan.yaml, in order."""
    if not archive.is_dir():
        raise RefusedInput(archive, "no such folder, expected an archive of scans")
    for folder, below, files in os.walk(archive):
        below.sort()
        if SCAN_FILE in files:
            below.clear()  # thousands of frames may lie below
            yield Path(folder)

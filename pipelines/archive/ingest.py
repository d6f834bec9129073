"""Ingest of scans by a command: films into Zarr, camera by camera."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from footscan.frames.film import film_files
from footscan.frames.ingest import ingest_background, ingest_film
from footscan.frames.repack import repack
from footscan.recordings.scans import SCAN_FILE, RecordedScan, read_scan, scan_folders
from pipelines.engine.progress import OnProgress, unheard
from schemas.base.errors import FootscanError, RefusedInput
from schemas.scan import CameraFilm


@dataclass(frozen=True)
class CameraIngest:
    """Result of the ingest of one camera's film and background, or of a scan that cannot be read."""

    scan: str
    camera: int | None
    """Camera number; None for a whole scan."""
    frames: int = 0
    lost: int = 0
    """Number of frames that the film counts but has no image of."""
    film_bytes: int = 0
    """Size of the film and its background."""
    store_bytes: int = 0
    """Size of their Zarr arrays."""
    files_fewer: int = 0
    """Number of files by which a repack made them fewer."""
    problem: str | None = None
    exit_status: int = 0
    """Exit status that a command for this camera alone would have, see `schemas.base.errors`."""

    def to_json(self) -> dict[str, Any]:
        """Return the fields by name."""
        return dict(vars(self))


def ingest_scans(folders: Sequence[Path], on_progress: OnProgress = unheard) -> list[CameraIngest]:
    """Ingest the films of scan folders, and of all scans in archives; a failure affects its own camera only.

    `on_progress` is called with the scans that have ended and their number.
    """
    return _each_camera(folders, _ingest, on_progress)


def repack_scans(folders: Sequence[Path], on_progress: OnProgress = unheard) -> list[CameraIngest]:
    """Gather the frames of earlier versions' arrays, one file a frame, in one file a camera; no film is read.

    A failure affects its own camera only, and leaves its array as it was.
    """
    return _each_camera(folders, _repack, on_progress)


def _each_camera(
    folders: Sequence[Path], work: Callable[[RecordedScan, CameraFilm], CameraIngest], on_progress: OnProgress
) -> list[CameraIngest]:
    ends: list[CameraIngest] = []
    are_scans = [(folder / SCAN_FILE).exists() or not folder.is_dir() for folder in folders]
    of_folder = [[f] if is_scan else list(scan_folders(f)) for f, is_scan in zip(folders, are_scans, strict=True)]
    total, done = sum(map(len, of_folder)), count(1)
    for folder, is_scan, scans in zip(folders, are_scans, of_folder, strict=True):
        for scan_folder in scans:
            ends += _each_of_scan(scan_folder, None if is_scan else folder, work)
            on_progress(next(done), total)
        if not scans:
            problem = str(RefusedInput(folder, "holds no scan, expected folders with a scan.yaml"))
            ends.append(CameraIngest(str(folder), None, problem=problem, exit_status=RefusedInput.exit_status))
    return ends


def _each_of_scan(
    folder: Path, archive: Path | None, work: Callable[[RecordedScan, CameraFilm], CameraIngest]
) -> list[CameraIngest]:
    try:
        scan = read_scan(folder, archive)
    except FootscanError as error:
        return [CameraIngest(str(folder), None, problem=str(error), exit_status=error.exit_status)]
    ends = []
    for camera in scan.document.cameras:
        try:
            ends.append(work(scan, camera))
        except FootscanError as error:
            ends.append(CameraIngest(scan.name, camera.id, problem=str(error), exit_status=error.exit_status))
    return ends


def _ingest(scan: RecordedScan, camera: CameraFilm) -> CameraIngest:
    films = [scan.film(camera)]
    manifest = ingest_film(scan.film(camera), scan.array(camera))
    background = scan.background(camera)
    if background is not None:
        films.append(background)
        ingest_background(background, scan.background_array(camera), len(manifest.frames), manifest.size)
    size = sum(file.stat().st_size for film in films for file in film_files(film))
    lost = manifest.frames.count(None)
    return CameraIngest(scan.name, camera.id, len(manifest.frames), lost, size, _bytes(_arrays(scan, camera)))


def _repack(scan: RecordedScan, camera: CameraFilm) -> CameraIngest:
    arrays = _arrays(scan, camera)
    fewer = sum(repack(array) for array in arrays)
    return CameraIngest(scan.name, camera.id, store_bytes=_bytes(arrays), files_fewer=fewer)


def _arrays(scan: RecordedScan, camera: CameraFilm) -> list[Path]:
    """The arrays of a camera that are there: of its film, and of its background."""
    return [array for array in (scan.array(camera), scan.background_array(camera)) if array.is_dir()]


def _bytes(arrays: Sequence[Path]) -> int:
    return sum(file.stat().st_size for array in arrays for file in array.iterdir())

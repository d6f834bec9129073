"""Ingest of scans by a command: films into Zarr, camera by camera."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from footscan.frames.film import film_files
from footscan.frames.ingest import ingest_background, ingest_film
from footscan.recordings.scans import SCAN_FILE, read_scan, scan_folders
from schemas.base.errors import FootscanError, RefusedInput


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
    problem: str | None = None
    exit_status: int = 0
    """Exit status that a command for this camera alone would have, see `schemas.base.errors`."""

    def to_json(self) -> dict[str, Any]:
        """Return the fields by name."""
        return dict(vars(self))


def ingest_scans(folders: Sequence[Path]) -> list[CameraIngest]:
    """Ingest the films of scan folders, and of all scans in archives; a failure affects its own camera only."""
    ends: list[CameraIngest] = []
    for folder in folders:
        count_before = len(ends)
        is_scan = (folder / SCAN_FILE).exists() or not folder.is_dir()
        for scan_folder in [folder] if is_scan else scan_folders(folder):
            ends += _ingest_scan(scan_folder, None if is_scan else folder)
        if len(ends) == count_before:
            problem = str(RefusedInput(folder, "holds no scan, expected folders with a scan.yaml"))
            ends.append(CameraIngest(str(folder), None, problem=problem, exit_status=RefusedInput.exit_status))
    return ends


def _ingest_scan(folder: Path, archive: Path | None) -> list[CameraIngest]:
    try:
        scan = read_scan(folder, archive)
    except FootscanError as error:
        return [CameraIngest(str(folder), None, problem=str(error), exit_status=error.exit_status)]
    ends = []
    for camera in scan.document.cameras:
        arrays = {scan.film(camera): scan.array(camera)}
        background = scan.background(camera)
        try:
            manifest = ingest_film(scan.film(camera), scan.array(camera))
            if background is not None:
                arrays[background] = scan.background_array(camera)
                ingest_background(background, arrays[background], len(manifest.frames), manifest.size)
            size = sum(file.stat().st_size for film in arrays for file in film_files(film))
        except FootscanError as error:
            ends.append(CameraIngest(scan.name, camera.id, problem=str(error), exit_status=error.exit_status))
            continue
        store = sum(file.stat().st_size for array in arrays.values() for file in array.iterdir())
        lost = manifest.frames.count(None)
        ends.append(CameraIngest(scan.name, camera.id, len(manifest.frames), lost, size, store))
    return ends

"""Ingesting scans by hand: films into Zarr, camera by camera."""

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
    """What became of one camera's film and background; of a whole scan where that could not be read."""

    scan: str
    camera: int | None
    frames: int = 0
    lost: int = 0
    """Frames that the film has a place for, but no picture."""
    film_bytes: int = 0
    """Of the film and its background, as `store_bytes`."""
    store_bytes: int = 0
    problem: str | None = None
    exit_status: int = 0
    """Of a command for this camera alone, see `schemas.base.errors`."""

    def to_json(self) -> dict[str, Any]:
        """Its fields."""
        return dict(vars(self))


def ingest_scans(folders: Sequence[Path]) -> list[CameraIngest]:
    """Ingest the films of scan folders, and of all scans in archives; what fails costs its own camera."""
    ends: list[CameraIngest] = []
    for folder in folders:
        found = len(ends)
        is_scan = (folder / SCAN_FILE).exists() or not folder.is_dir()
        for scan_folder in [folder] if is_scan else scan_folders(folder):
            ends += _ingest_scan(scan_folder, None if is_scan else folder)
        if len(ends) == found:
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
                ingest_background(background, arrays[background], len(manifest.frames))
            size = sum(file.stat().st_size for film in arrays for file in film_files(film))
        except FootscanError as error:
            ends.append(CameraIngest(scan.name, camera.id, problem=str(error), exit_status=error.exit_status))
            continue
        store = sum(file.stat().st_size for array in arrays.values() for file in array.iterdir())
        lost = manifest.frames.count(None)
        ends.append(CameraIngest(scan.name, camera.id, len(manifest.frames), lost, size, store))
    return ends

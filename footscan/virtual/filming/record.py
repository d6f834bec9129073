"""Records a scan: a mesh in, `scan.yaml` and eight films out; on request eight more films with the laser off."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from footscan.virtual.filming.film import write_film
from footscan.virtual.filming.renderers import Shot, shoot
from footscan.virtual.filming.stripe_truth import write_stripe_truth
from footscan.virtual.optics.scanner import HEIGHT, WIDTH
from footscan.virtual.optics.scene import SKIN, Mesh, Surface
from schemas.base.json_files import validate
from schemas.parameters.simulation import SimulationSettings
from schemas.scan import Scan

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Progress = Callable[[int, int], None]

CAMERAS = range(1, 9)
OFF = "-off"
"""Follows the camera's number in the name of a film with the laser off."""


class ScanName(NamedTuple):
    """The fields of scan.yaml that say whose foot was scanned."""

    patient: str
    scan: str
    side: str


class ScanExtras(NamedTuple):
    """The optional contents of a scan folder."""

    calibration: str | None = None
    """Path of the calibration file relative to the folder, for scan.yaml."""
    truth: bool = True
    """True if the mesh is written as `truth.stl`."""
    stripe_truth: bool = False
    """True if the exact stripe centres are written as `truth/cam<n>.csv`."""
    laser_off: bool = False
    """True if each frame is taken again with the laser off, into `cam<n>-off.avi`, the camera's background."""


def record_scan(
    mesh: Mesh,
    folder: Path,
    name: ScanName,
    settings: SimulationSettings,
    *,
    extras: ScanExtras = ScanExtras(),  # noqa: B008 (immutable: all calls may share it)
    surface: Surface = SKIN,
    progress: Progress | None = None,
    workers: int = 2,
) -> None:
    """Film a mesh with all eight cameras while the heads travel along it; `scan.yaml` is written last.

    Parameters
    ----------
    mesh : mm, scanner frame: along X within the travel, on the glass at Z = 0, around Y = 0.
    folder : folder of the scan; created if missing.
    progress : called with the number of frames done and in total; films with the laser off are counted separately.
    workers : number of processes; the bytes do not depend on it.

    Raises
    ------
    RefusedInput
        `patient`, `scan` or `side` breaks the format of scan.yaml.
    """
    document: dict[str, Any] = {
        "format": "footscan.scan/1",
        **name._asdict(),
        "travel": {"start_mm": settings.start_mm, "step_mm": settings.step_mm},
        **({"calibration": extras.calibration} if extras.calibration else {}),
        **({"truth": "truth.stl"} if extras.truth else {}),
        "cameras": [
            {"id": camera, "file": film_name(camera)}
            | ({"background": film_name(camera, OFF)} if extras.laser_off else {})
            for camera in CAMERAS
        ],
    }
    validate(folder / "scan.yaml", Scan, document)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scan.yaml").unlink(missing_ok=True)
    shots = [Shot(frame, settings.start_mm + frame * settings.step_mm, 0) for frame in range(settings.frames)]
    film_cameras([mesh], surface, shots, folder, settings, progress, workers)
    if extras.laser_off:
        # New frame numbers give the second exposures their own noise and flicker.
        shots_again = [shot._replace(frame=settings.frames + shot.frame) for shot in shots]
        dark = settings.model_copy(update={"laser_exposure": 0.0})
        film_cameras([mesh], surface, shots_again, folder, dark, progress, workers, OFF)
    if extras.stripe_truth:
        write_stripe_truth(mesh, surface, shots, folder / "truth", settings)
    if extras.truth:
        write_stl(folder / "truth.stl", mesh.vertices, mesh.faces)
    write_yaml(folder / "scan.yaml", document)


def film_cameras(
    meshes: list[Mesh],
    surface: Surface,
    shots: list[Shot],
    folder: Path,
    settings: SimulationSettings,
    progress: Progress | None,
    workers: int,
    ending: str = "",
) -> None:
    """Write `cam1.avi` to `cam8.avi`, with one frame for each of `shots`; `ending` follows the camera's number."""
    total, done = len(CAMERAS) * len(shots), 0
    pictures: list[bytes] = []
    for camera, part in shoot(meshes, surface, list(CAMERAS), shots, settings, workers):
        pictures += part
        done += len(part)
        if len(pictures) == len(shots):
            write_film(folder / film_name(camera, ending), pictures, WIDTH, HEIGHT, settings.frames_per_second)
            pictures = []
        if progress is not None:
            progress(done, total)


def film_name(camera: int, ending: str = "") -> str:
    """Returns the file name of a camera's film, as in scan.yaml."""
    return f"cam{camera}{ending}.avi"


def write_yaml(path: Path, document: dict[str, Any]) -> None:
    """Write `document` as YAML, fields in their order; the file appears under its name when it is complete."""
    partial = path.with_name(path.name + ".part")
    partial.write_text(yaml.safe_dump(document, sort_keys=False, default_flow_style=None), encoding="utf-8")
    partial.replace(path)


def write_stl(path: Path, vertices: Floats, faces: Ints) -> None:
    """Write a mesh as binary STL, mm.

    vertices : (N, 3) float64. faces : (M, 3) int64.
    """
    corners = vertices[faces]
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    records = np.zeros(len(faces), dtype=[("normal", "<3f4"), ("corners", "<(3,3)f4"), ("attribute", "<u2")])
    records["normal"] = crossed / np.maximum(np.linalg.norm(crossed, axis=1, keepdims=True), 1e-30)
    records["corners"] = corners
    header = b"footscan virtual scanner, mm".ljust(80)
    path.write_bytes(header + struct.pack("<I", len(faces)) + records.tobytes())

"""Recording a scan: a mesh in, `scan.yaml` and eight films out, and eight more with the laser off where asked for."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

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
"""Behind the camera's number in the name of a film with the laser off."""


def record_scan(
    vertices: Floats,
    faces: Ints,
    folder: Path,
    *,
    patient: str,
    scan: str,
    side: str,
    settings: SimulationSettings,
    calibration: str | None = None,
    truth: bool = True,
    stripe_truth: bool = False,
    laser_off: bool = False,
    surface: Surface = SKIN,
    progress: Progress | None = None,
    workers: int = 2,
) -> None:
    """Films a mesh with all eight cameras while the heads travel along it; `scan.yaml` is written last.

    Parameters
    ----------
    vertices : (N, 3) float64, mm, scanner frame: along X within the travel, on the glass at Z = 0, around Y = 0.
    faces : (M, 3) int, counter-clockwise seen from outside.
    folder : where the scan goes; made if missing.
    calibration : path of the calibration file relative to `folder`, to be named in `scan.yaml`.
    truth : whether the mesh goes with it as `truth.stl`.
    stripe_truth : whether the exact stripe centres go with it as `truth/cam<n>.csv`.
    laser_off : whether each frame is taken again with the laser off, into `cam<n>-off.avi`, the camera's background.
    progress : called with frames done and frames in all; films with the laser off are counted anew.
    workers : processes; the bytes do not depend on it.

    Raises
    ------
    RefusedInput
        `patient`, `scan` or `side` is not as scan.yaml must have it.
    """
    document: dict[str, Any] = {
        "format": "footscan.scan/1",
        "patient": patient,
        "scan": scan,
        "side": side,
        "travel": {"start_mm": settings.start_mm, "step_mm": settings.step_mm},
        **({"calibration": calibration} if calibration else {}),
        **({"truth": "truth.stl"} if truth else {}),
        "cameras": [
            {"id": camera, "file": film_name(camera), **({"background": film_name(camera, OFF)} if laser_off else {})}
            for camera in CAMERAS
        ],
    }
    validate(folder / "scan.yaml", Scan, document)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scan.yaml").unlink(missing_ok=True)
    mesh = Mesh(np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64))
    shots = [Shot(frame, settings.start_mm + frame * settings.step_mm, 0) for frame in range(settings.frames)]
    film_cameras([mesh], surface, shots, folder, settings, progress, workers)
    if laser_off:
        # Second exposures: by numbers of their own they have noise and flicker of their own.
        again = [shot._replace(frame=settings.frames + shot.frame) for shot in shots]
        dark = settings.model_copy(update={"laser_exposure": 0.0})
        film_cameras([mesh], surface, again, folder, dark, progress, workers, OFF)
    if stripe_truth:
        write_stripe_truth(mesh, surface, shots, folder / "truth", settings)
    if truth:
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
    """Writes `cam1.avi` to `cam8.avi`, an `ending` behind the number, each with one frame for each of `shots`."""
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
    """The film of a camera, as scan.yaml names it."""
    return f"cam{camera}{ending}.avi"


def write_yaml(path: Path, document: dict[str, Any]) -> None:
    """`document` as YAML, its fields in their order, under its name when it is whole."""
    partial = path.with_name(path.name + ".part")
    partial.write_text(yaml.safe_dump(document, sort_keys=False, default_flow_style=None), encoding="utf-8")
    partial.replace(path)


def write_stl(path: Path, vertices: Floats, faces: Ints) -> None:
    """The mesh as binary STL, mm."""
    corners = vertices[faces]
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    records = np.zeros(len(faces), dtype=[("normal", "<3f4"), ("corners", "<(3,3)f4"), ("attribute", "<u2")])
    records["normal"] = crossed / np.maximum(np.linalg.norm(crossed, axis=1, keepdims=True), 1e-30)
    records["corners"] = corners
    header = b"footscan virtual scanner, mm".ljust(80)
    path.write_bytes(header + struct.pack("<I", len(faces)) + records.tobytes())

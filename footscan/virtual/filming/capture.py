"""A calibration capture: the reference object under the stripe, and its corners as a person would click them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.filming.record import CAMERAS, film_cameras, write_yaml
from footscan.virtual.filming.renderers import Shot
from footscan.virtual.filming.stripe_truth import is_lit, is_seen
from footscan.virtual.optics.scanner import VirtualScanner, standard_scanner
from footscan.virtual.optics.scene import MATT_GREY, Mesh, Scene
from schemas.mounting import CaptureCamera
from schemas.parameters.simulation import SimulationSettings
from schemas.reference import Capture, ReferenceObject

Floats = NDArray[np.float64]

HALF_LENGTH_MM = 40.0
"""The object reaches this far before and behind the laser plane. Chosen by hand."""
BESIDE_MM = 0.4
"""A corner can be clicked if the stripe this far beside it, on one of its two sides, is lit and seen.
Chosen by hand."""


def record_capture(
    folder: Path,
    reference: ReferenceObject,
    *,
    settings: SimulationSettings,
    clicks_seed: int = 1,
    progress: Callable[[int, int], None] | None = None,
    workers: int = 2,
) -> None:
    """Film the reference object in all its placements with all eight cameras, and write the chart of its corners.

    `folder` (created if missing) gets `cam1.avi` to `cam8.avi` with one frame a placement, `reference.yaml`,
    `chart.csv` with the columns camera,point,x_mm,y_mm,z_mm,i,j, and last `capture.yaml`. The chart holds only
    corners that are lit, seen and within the picture, off by `settings.click_error_px` and rounded to half a pixel.
    The settings' travel is not used: the laser plane stands at X = 0. `workers` is the number of
    processes; the bytes do not depend on it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "capture.yaml").unlink(missing_ok=True)
    meshes = [prism(np.asarray(reference.profile_mm) + np.asarray(place)) for place in reference.placements_mm]
    shots = [Shot(placement, 0.0, placement) for placement in range(len(meshes))]
    film_cameras(meshes, MATT_GREY, shots, folder, settings, progress, workers)
    _write_chart(folder / "chart.csv", reference, settings, clicks_seed)
    write_yaml(folder / "reference.yaml", reference.model_dump(mode="json"))
    write_yaml(folder / "capture.yaml", capture_document().model_dump(mode="json", exclude_unset=True))


def capture_document() -> Capture:
    """Returns the contents of capture.yaml, the same for all captures."""
    cameras = [CaptureCamera(id=camera, file=f"cam{camera}.avi") for camera in CAMERAS]
    return Capture(format="footscan.capture/1", reference="reference.yaml", x_mm=0.0, cameras=cameras)


def prism(profile: Floats) -> Mesh:
    """Build the prism along X over a closed `profile` (C, 2) of (Y, Z) in mm; its ends are open, and dark inside."""
    profile = _counter_clockwise(profile)
    count = len(profile)
    front = np.column_stack([np.full(count, HALF_LENGTH_MM), profile])
    back = np.column_stack([np.full(count, -HALF_LENGTH_MM), profile])
    here, there = np.arange(count), (np.arange(count) + 1) % count
    faces = np.concatenate(
        [np.column_stack([here, here + count, there]), np.column_stack([there, here + count, there + count])]
    )
    return Mesh(np.concatenate([front, back]), faces)


def visible_corners(
    scanner: VirtualScanner, profile: Floats, settings: SimulationSettings
) -> dict[int, NDArray[np.bool_]]:
    """Returns for each camera which corners of `profile` (C, 2), mm, can be clicked: (C,) bool."""
    scene = Scene(prism(profile), MATT_GREY)
    turned = _signed_area(profile) < 0.0
    visible = {camera.id: np.zeros(len(profile), dtype=np.bool_) for camera in scanner.cameras}
    for side in (-1, 1):  # the edges that end and begin at each corner
        way = np.roll(profile, -side, axis=0) - profile
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        points = np.column_stack([np.zeros(len(profile)), profile + BESIDE_MM * way])
        outward = np.column_stack([np.zeros(len(profile)), way[:, 1], -way[:, 0]]) * (-side if turned else side)
        lit = is_lit(scene, scanner, 0.0, points, outward, settings)
        for camera in scanner.cameras:
            visible[camera.id] |= lit & is_seen(scene, camera, 0.0, points, outward)
    return visible


def _write_chart(path: Path, reference: ReferenceObject, settings: SimulationSettings, clicks_seed: int) -> None:
    scanner = standard_scanner(settings.scanner_seed, settings.distortion)
    rows: dict[int, list[tuple[float, ...]]] = {camera.id: [] for camera in scanner.cameras}
    random = np.random.default_rng([clicks_seed, 5])
    for placement in reference.placements_mm:
        profile = np.asarray(reference.profile_mm) + np.asarray(placement)
        visible = visible_corners(scanner, profile, settings)
        for camera in scanner.cameras:
            exact = camera.project_plane(profile[:, 0], profile[:, 1])
            clicked = np.round(2.0 * (exact + random.normal(0.0, settings.click_error_px, exact.shape))) / 2.0
            rows[camera.id] += [(*profile[k], *clicked[k]) for k in np.flatnonzero(visible[camera.id])]
    lines = ["camera,point,x_mm,y_mm,z_mm,i,j\n"]
    for camera_id, points in rows.items():
        lines += [f"{camera_id},{n},0,{y:g},{z:g},{i:.1f},{j:.1f}\n" for n, (y, z, i, j) in enumerate(points, start=1)]
    path.write_text("".join(lines), encoding="utf-8")


def _counter_clockwise(profile: Floats) -> Floats:
    """The profile in the order in which it runs counter-clockwise seen from +X."""
    return profile[::-1] if _signed_area(profile) < 0.0 else profile


def _signed_area(profile: Floats) -> float:
    y, z = profile.T
    return float(np.sum(y * np.roll(z, -1) - z * np.roll(y, -1)) / 2.0)

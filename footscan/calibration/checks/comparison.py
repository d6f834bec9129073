"""Comparison of two calibrations of one scanner, camera by camera."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.maps import is_supported, model_of, to_world
from footscan.calibration.models.selection import rms
from schemas.base.image_size import FRAME_SIZE
from schemas.calibration import Calibration, CameraCalibration

Floats = NDArray[np.float64]

MOST_A_SIDE = 800
"""Number of pixels a side that are compared at most: every pixel, or every second, third, ...: a bound of time."""
FOLDS_EVERY = 7
"""Step of the pixels at which folds are searched, since slopes take longer than all the rest: a bound of time."""
FARTHEST_MM = 1e6
"""Distance from which a map of a pixel is beyond its horizon, so that lengths have no meaning: a kilometre."""


@dataclass(frozen=True)
class CameraComparison:
    """One camera in two calibrations, A and B; differences are B minus A over the pixels for which both hold."""

    camera: int
    """Number of the camera, or of its view of a second laser as in `schemas.calibration.view_number`."""
    model_a: str | None
    """None if A has no such camera."""
    model_b: str | None
    image_a_px: tuple[int, int] | None
    """Columns and rows; None if A does not state them."""
    image_b_px: tuple[int, int] | None
    shared_fraction: float | None = None
    """Pixels in both regions, of those in either; None if a region is unknown."""
    pixels: int = 0
    """Number of compared pixels."""
    mean_y_mm: float | None = None
    """None, like all figures below, without a comparison; `remarks` then gives the reason."""
    mean_z_mm: float | None = None
    rms_mm: float | None = None
    """Root mean square distance."""
    largest_mm: float | None = None
    largest_at_px: tuple[float, float] | None = None
    """The pixel (i, j) with the largest distance."""
    turn_deg: float | None = None
    """Rotation of B against A, from Y towards Z, with the least distances."""
    left_rms_mm: float | None = None
    """Root mean square distance after that rotation and the best shift: the part that no motion of the scanner
    explains."""
    remarks: tuple[str, ...] = ()


def compare_calibrations(a: Calibration, b: Calibration) -> list[CameraComparison]:
    """Compare all cameras of both calibrations, in the order of their numbers."""
    in_a = {camera.view: camera for camera in a.cameras}
    in_b = {camera.view: camera for camera in b.cameras}
    return [_compare(number, in_a.get(number), in_b.get(number)) for number in sorted(in_a | in_b)]


def worst_beyond(comparisons: list[CameraComparison], tolerance_mm: float) -> CameraComparison | None:
    """Find the camera with the largest difference (rms) above the tolerance; None if all are within.

    A camera that could not be compared counts as the worst.
    """
    worst = max(comparisons, key=lambda camera: np.inf if camera.rms_mm is None else camera.rms_mm)
    return None if worst.rms_mm is not None and worst.rms_mm <= tolerance_mm else worst


def _compare(number: int, a: CameraCalibration | None, b: CameraCalibration | None) -> CameraComparison:
    """Compare one camera, which one of the calibrations may not have."""
    common = CameraComparison(
        number,
        None if a is None else model_of(a.map)[0].name,
        None if b is None else model_of(b.map)[0].name,
        None if a is None else a.image_px,
        None if b is None else b.image_px,
    )
    if a is None or b is None:
        return replace(common, remarks=(f"in {'B' if a is None else 'A'} alone",))
    remarks = _remarks(a, b)
    pixels, shared = _shared_pixels(a, b)
    common = replace(common, shared_fraction=shared, pixels=len(pixels))
    if len(pixels) == 0:
        return replace(common, remarks=(*remarks, "the regions share no pixel"))
    world_a, world_b = to_world(a, pixels), to_world(b, pixels)
    far = [name for name, world in (("A", world_a), ("B", world_b)) if not np.abs(world).max() <= FARTHEST_MM]
    if far:
        reach = f"{' and '.join(far)} would place pixels more than a kilometre away"
        return replace(common, remarks=(*remarks, reach))
    several = [name for name, camera in (("A", a), ("B", b)) if not _is_one_to_one(camera, pixels)]
    remarks += [f"{name} takes several pixels to one place" for name in several]
    return _with_figures(replace(common, remarks=tuple(remarks)), pixels, world_a, world_b)


def _remarks(a: CameraCalibration, b: CameraCalibration) -> list[str]:
    """Limits of the comparison: images of different sizes, unknown regions."""
    remarks = []
    if a.image_px and b.image_px and a.image_px != b.image_px:
        sizes = ["{} x {}".format(*image_px) for image_px in (a.image_px, b.image_px)]
        remarks.append(f"A holds for images of {sizes[0]} pixels, B for {sizes[1]}")
    without_region = [name for name, camera in (("A", a), ("B", b)) if not camera.region_px]
    if len(without_region) == 2:
        remarks.append("neither says its region: compared over the image")
    elif without_region:
        remarks.append(f"{without_region[0]} does not say its region: compared over that of the other")
    return remarks


def _shared_pixels(a: CameraCalibration, b: CameraCalibration) -> tuple[Floats, float | None]:
    """The pixels (N, 2) in both regions, and their share of those in either; None if a region is unknown."""
    corners = np.array([*a.region_px, *b.region_px], np.float64)
    if len(corners) == 0:
        images = [image_px for image_px in (a.image_px, b.image_px) if image_px] or [FRAME_SIZE.px]
        return _grid(np.zeros(2), np.min(images, axis=0) - 1.0), None
    grid = _grid(corners.min(axis=0), corners.max(axis=0))
    in_a, in_b = is_supported(a, grid), is_supported(b, grid)
    shared = grid[in_a & in_b]
    if not (a.region_px and b.region_px):
        return shared, None
    return shared, len(shared) / max(int(np.sum(in_a | in_b)), 1)


def _grid(low: Floats, high: Floats) -> Floats:
    """Whole pixels (N, 2) from `low` (2,) to `high` (2,), row by row."""
    first, last = np.ceil(low), np.floor(high)
    steps = np.maximum(np.ceil((last - first + 1) / MOST_A_SIDE), 1.0)
    i, j = np.meshgrid(*(np.arange(first[k], last[k] + 1, steps[k]) for k in (0, 1)))
    return np.column_stack([i.ravel(), j.ravel()])


def _is_one_to_one(camera: CameraCalibration, pixels: Floats) -> bool:
    """True if the map keeps its orientation, which changes at a fold and beyond a horizon."""
    model, parameters = model_of(camera.map)
    slope = model.by_pixels(parameters, pixels[::FOLDS_EVERY])
    areas = slope[:, 0, 0] * slope[:, 1, 1] - slope[:, 0, 1] * slope[:, 1, 0]
    return bool(areas.min() > 0 or areas.max() < 0)


def _with_figures(common: CameraComparison, pixels: Floats, a: Floats, b: Floats) -> CameraComparison:
    """Add the figures of two maps that take `pixels` (N, 2) to the places `a` and `b`, each (N, 2), mm."""
    distances = np.hypot(*(b - a).T)
    largest = int(distances.argmax())
    mean_y, mean_z = (b - a).mean(axis=0).tolist()
    turn, left = _rigid(a, b)
    return replace(
        common,
        mean_y_mm=mean_y,
        mean_z_mm=mean_z,
        rms_mm=rms(distances),
        largest_mm=float(distances[largest]),
        largest_at_px=(float(pixels[largest, 0]), float(pixels[largest, 1])),
        turn_deg=float(np.rad2deg(turn)),
        left_rms_mm=rms(left),
    )


def _rigid(a: Floats, b: Floats) -> tuple[float, Floats]:
    """The rotation, rad, of the rigid transform that takes points `a` nearest to `b`, and the distances (N,) left.

    Both are (N, 2). With (Y, Z) relative to their means as Y + iZ, the rotation is the argument of the sum of
    b conj(a): the least squares of S. Umeyama, IEEE TPAMI 13(4), 1991, 376-380, doi:10.1109/34.88573, in two
    dimensions.
    """
    from_a, from_b = (points - points.mean(axis=0) for points in (a, b))
    along = float(np.sum(from_a * from_b))
    across = float(np.sum(from_a[:, 0] * from_b[:, 1] - from_a[:, 1] * from_b[:, 0]))
    turn = float(np.arctan2(across, along))
    y, z = from_a.T
    turned = np.column_stack([np.cos(turn) * y - np.sin(turn) * z, np.sin(turn) * y + np.cos(turn) * z])
    return turn, np.hypot(*(from_b - turned).T)

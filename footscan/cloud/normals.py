"""Normals of a cloud, oriented outward."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.planes import SUMS, add_point, plane_normal
from footscan.cloud.points import PLANE_MM, coordinates, stripe_step
from footscan.cloud.views import View
from footscan.compiled import compiled
from footscan.mesh.voxels import EMPTY, voxelise
from schemas.base.errors import Finding
from schemas.parameters.normals import NormalParameters

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

CELLS_A_RADIUS = 2
"""Cells a radius: the side of the cells in which neighbours are searched. Chosen for speed."""
FEWEST = 6
"""Points from which a plane is fitted, the point itself included; with fewer the radius is doubled. Chosen by hand."""
LEAST_BREADTH = 0.15
"""Least standard deviation of the neighbours across their longest direction, relative to the radius; with less the
radius is doubled, since points of one stripe lie on a line. Chosen by hand."""
FAR = 6
"""Radii within which the next stripe is sought where the neighbours of a point lie on one stripe. Chosen by hand."""
PASSES = 50
"""How often the orientation spreads from normals to their neighbours at most: a bound of time."""
CAMERAS = 256
"""Numbers that a camera can have (one byte)."""


class Cells(NamedTuple):
    """The cells of points (N, 3) that are sorted by cell."""

    starts: NDArray[np.int64]
    """(V + 1,): where the points of each cell begin."""
    number: Ints
    """As in `Voxels`."""
    place: Ints
    """As in `Voxels`."""
    window: NDArray[np.int64]
    """(3,): how many cells away along each axis a neighbour may be."""


def estimate_normals(
    cloud: NDArray[np.void], views: Mapping[int, View], parameters: NormalParameters
) -> NDArray[np.float32]:
    """Estimate the normals of a cloud from planes through the neighbours of each point.

    A point's normal points to the side of the camera that saw it. Where the camera looked along the surface, or its
    position is unknown, the normals of the neighbours decide; without neighbours, the normal points away from the
    cloud's middle.

    Parameters
    ----------
    cloud : (N,) of `POINT_DTYPE`, mm, scanner frame
    views : camera -> view, with the positions of the cameras relative to the laser plane

    Returns
    -------
    (N, 3) float32, unit normals, scanner frame.

    Raises
    ------
    Finding
        All points lie in one laser plane, or some are not finite.

    Examples
    --------
    A flat sheet at Z = 10 mm without known cameras; the sign of its normals is open:

    >>> from footscan.cloud.points import make_points
    >>> x, y = (grid.ravel() for grid in np.meshgrid(np.arange(10.0), np.arange(10.0)))
    >>> sheet = make_points(np.column_stack([x, y, np.full(100, 10.0)]), 1, x.astype(int))
    >>> normals = estimate_normals(sheet, {}, NormalParameters())
    >>> print(normals.shape, bool(np.allclose(np.abs(normals), [0, 0, 1], atol=1e-5)))
    (100, 3) True
    """
    if not len(cloud):
        return np.zeros((0, 3), np.float32)
    xyz, step = coordinates(cloud), stripe_step(cloud)
    if not np.isfinite(xyz).all():
        raise Finding("the cloud has points without coordinates, expected them to be dropped")
    if step == 0.0:
        raise Finding(f"{len(cloud)} points in one plane, expected stripes at several places of the travel")
    radius = max(parameters.radius_steps * step, parameters.smallest_radius_mm)
    voxels = voxelise(xyz, (radius / CELLS_A_RADIUS,) * 3)
    order = np.argsort(voxels.voxel, kind="stable")
    starts = np.searchsorted(voxels.voxel[order], np.arange(len(voxels.place) + 1))
    windows = np.ceil(radius / voxels.size).astype(np.int64)
    cells = Cells(starts, voxels.number, voxels.place, windows)

    places = np.ascontiguousarray(xyz[order])
    normals = _fit(places, radius, *cells)
    cosines = _cosines(cloud.take(order), places, normals, views)
    normals[cosines < 0] *= -1
    sure = np.abs(cosines) >= parameters.grazing
    _spread(places, radius, cells, np.where(sure, PASSES, 0), normals)
    oriented = np.empty((len(cloud), 3), np.float32)
    oriented[order] = normals
    return oriented


@compiled
def _fit(
    xyz: Floats, radius: float, starts: NDArray[np.int64], number: Ints, place: Ints, window: NDArray[np.int64]
) -> Floats:
    """(N, 3) unit normals, of either sign, of planes through the points within `radius`; near points weigh more.

    The points `xyz` (N, 3) are sorted by cell.
    """
    normals = np.empty(xyz.shape)
    near, wide, far = np.empty(xyz.shape), np.empty(xyz.shape), np.empty(xyz.shape)
    sums = np.empty(SUMS)
    for v in range(len(place)):
        count = _gather(xyz, starts, number, place[v], window, near)
        wide_count = far_count = 0
        for n in range(starts[v], starts[v + 1]):
            narrow = _sum_up(near[:count], xyz[n], radius, sums)
            nx, ny, nz, _, breadth = plane_normal(sums)
            if narrow or breadth < (LEAST_BREADTH * radius) ** 2:
                if wide_count == 0:
                    wide_count = _gather(xyz, starts, number, place[v], 2 * window, wide)
                _sum_up(wide[:wide_count], xyz[n], 2.0 * radius, sums)
                nx, ny, nz, _, _ = plane_normal(sums)
                if sums[4] * sums[0] - sums[1] ** 2 < (PLANE_MM * sums[0]) ** 2:  # the points of one stripe alone
                    if far_count == 0:
                        far_count = _gather(xyz, starts, number, place[v], FAR * window, far)
                    nx, ny, nz = _beside_stripe(xyz[n], sums, far[:far_count], nx, ny, nz)
            normals[n, 0], normals[n, 1], normals[n, 2] = nx, ny, nz
    return normals


@compiled
def _beside_stripe(
    middle: Floats, sums: Floats, far: Floats, nx: float, ny: float, nz: float
) -> tuple[float, float, float]:
    """The normal of the surface between a stripe and the nearest point of another one; the given one without that.

    The outermost stripe on a heel is farther from the next one than its neighbours are from each other. The plane
    through them is that of the laser.

    sums : over the points of the stripe near `middle`. far : points around
    """
    nearest, kx, ky, kz = np.inf, 0.0, 0.0, 0.0
    for m in range(len(far)):
        x, y, z = far[m, 0] - middle[0], far[m, 1] - middle[1], far[m, 2] - middle[2]
        squared = x * x + y * y + z * z
        if abs(x) > PLANE_MM and squared < nearest:
            nearest, kx, ky, kz = squared, x, y, z
    yy = sums[7] * sums[0] - sums[2] ** 2
    yz = sums[8] * sums[0] - sums[2] * sums[3]
    zz = sums[9] * sums[0] - sums[3] ** 2
    angle = 0.5 * math.atan2(2.0 * yz, yy - zz)
    ty, tz = math.cos(angle), math.sin(angle)  # along the stripe
    x, y, z = ty * kz - tz * ky, tz * kx, -ty * kx
    length = math.sqrt(x * x + y * y + z * z)
    if not math.isfinite(nearest) or length == 0.0:
        return nx, ny, nz
    return x / length, y / length, z / length


@compiled
def _gather(
    xyz: Floats, starts: NDArray[np.int64], number: Ints, place: Ints, window: NDArray[np.int64], near: Floats
) -> int:
    """Copy the points of the cells around a place into `near`; returns their number."""
    count = 0
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for axis in range(3):  # a wide window reaches beyond the cells
        low[axis] = max(place[axis] - window[axis], 0)
        high[axis] = min(place[axis] + window[axis] + 1, number.shape[axis])
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            for k in range(low[2], high[2]):
                if number[i, j, k] != EMPTY:
                    for m in range(starts[number[i, j, k]], starts[number[i, j, k] + 1]):
                        near[count, 0], near[count, 1], near[count, 2] = xyz[m, 0], xyz[m, 1], xyz[m, 2]
                        count += 1
    return count


@compiled
def _sum_up(near: Floats, middle: Floats, radius: float, sums: Floats) -> bool:
    """Sum up the points within `radius` of `middle`, relative to it; True if they are too few for a plane."""
    sums[:] = 0.0
    count = 0
    reach = 1.0 / (radius * radius)
    for m in range(len(near)):
        x, y, z = near[m, 0] - middle[0], near[m, 1] - middle[1], near[m, 2] - middle[2]
        part = 1.0 - (x * x + y * y + z * z) * reach
        if part > 0.0:
            add_point(sums, x, y, z, part * part)
            count += 1
    return count < FEWEST


def _cosines(cloud: NDArray[np.void], xyz: Floats, normals: Floats, views: Mapping[int, View]) -> Floats:
    """(N,) cosines of the angles between the normals and the directions to the cameras; 0 for an unknown camera."""
    centres = np.full((CAMERAS, 3), np.nan)
    for camera, view in views.items():
        centres[camera] = view.centre
    towards = centres[cloud["camera"]] - xyz * [0.0, 1.0, 1.0]  # the laser plane of the head is at the point's X
    cosines: Floats = np.sum(normals * towards, axis=1) / np.linalg.norm(towards, axis=1)
    return np.where(np.isfinite(cosines), cosines, 0.0)


@compiled
def _spread(
    xyz: Floats,
    radius: float,
    cells: Cells,
    since: NDArray[np.int64],
    normals: Floats,
) -> None:
    """Orient normals by the sum of the certain normals around them; they are then certain for the next pass.

    `since` (N,): the pass from which each normal is certain, counted down; 0 for those that are not.
    """
    starts, _, place, _ = cells
    for step in range(PASSES - 1, 0, -1):
        has_changed = False
        for v in range(len(place)):
            for n in range(starts[v], starts[v + 1]):
                if since[n]:
                    continue
                vote = _vote(n, place[v], xyz, radius, cells, since, step, normals)
                if vote != 0.0:
                    has_changed = True
                    since[n] = step
                    if vote < 0.0:
                        normals[n] *= -1.0
        if not has_changed:
            break
    middle = np.array([np.mean(xyz[:, 0]), np.mean(xyz[:, 1]), np.mean(xyz[:, 2])])
    for n in range(len(xyz)):
        if since[n] == 0 and np.sum((xyz[n] - middle) * normals[n]) < 0.0:
            normals[n] *= -1.0


@compiled
def _vote(
    n: int,
    place: Ints,
    xyz: Floats,
    radius: float,
    cells: Cells,
    since: NDArray[np.int64],
    step: int,
    normals: Floats,
) -> float:
    """Weighted sum of the cosines between the normal of point `n`, in the cell at `place`, and certain ones around."""
    starts, number, _, window = cells
    total = 0.0
    for i in range(place[0] - window[0], place[0] + window[0] + 1):
        for j in range(place[1] - window[1], place[1] + window[1] + 1):
            for k in range(place[2] - window[2], place[2] + window[2] + 1):
                if number[i, j, k] == EMPTY:
                    continue
                for m in range(starts[number[i, j, k]], starts[number[i, j, k] + 1]):
                    part = 1.0 - np.sum((xyz[m] - xyz[n]) ** 2) / (radius * radius)
                    if since[m] > step and part > 0.0:
                        total += part * part * np.sum(normals[m] * normals[n])
    return total

"""The points of all cameras, sorted by laser plane, camera and stripe, and the intersection of normals with stripes."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import PLANE_MM, UNKNOWN_SIGMA_MM, coordinates, joined
from footscan.compiled import compiled
from footscan.rows import distinct_numbers

Floats = NDArray[np.float64]

LINK_MM = 1.5
"""Distance of consecutive points up to which they belong to one piece of the stripe. Chosen by hand."""
REACH = 3
"""Points before and after a point between which the direction of the stripe is taken. Chosen by hand."""
BENT_MM = 0.15
"""Distance of a point from the line between these from which the stripe has a corner. Chosen by hand."""
BLOCK = 16
"""Consecutive points that share a bounding box, by which distant points are skipped: a bound of time."""
LEAST_COSINE = 0.85
"""Cosine of the angle between the normals of two stripes, 32 degrees, beyond which they show different surfaces, or one
of them turns a corner. Chosen by hand."""
SMALLEST_SIGMA_MM = 1e-3
"""Lower bound of the standard deviations: weights stay finite."""


@dataclass(frozen=True)
class Stripes:
    """N points of C cameras in P laser planes, sorted by plane, camera, frame and place along the stripe."""

    points: NDArray[np.void]
    """(N,) of `POINT_DTYPE`."""
    cameras: NDArray[np.intp]
    """(C,) the numbers of the cameras, ascending."""
    camera: NDArray[np.intp]
    """(N,) index into `cameras`."""
    plane: NDArray[np.intp]
    """(N,) number of the plane, by ascending X."""
    starts: NDArray[np.intp]
    """(P * C + 1,) where the points of each plane and camera begin."""
    x: Floats
    """(N,) mm."""
    yz: Floats
    """(N, 2) mm."""
    sigma: Floats
    """(N,) standard deviation, mm, never 0."""
    linked: NDArray[np.bool_]
    """(N,) True if the stripe continues to the next point."""
    normals: Floats
    """(N, 2) unit normals of the stripes in their planes, of either sign; 0 for a single point."""
    bent: NDArray[np.bool_]
    """(N,) True where the stripe has a corner."""


class Traces(NamedTuple):
    """The arrays of `Stripes` that compiled loops need, with current coordinates and sigmas."""

    camera: NDArray[np.intp]
    plane: NDArray[np.intp]
    starts: NDArray[np.intp]
    x: Floats
    yz: Floats
    sigma: Floats
    normals: Floats
    linked: NDArray[np.bool_]
    around: Floats
    """The bounding boxes of `boxes`."""


def traces_of(stripes: Stripes, yz: Floats, sigma: Floats) -> Traces:
    """Select the traces of stripes, with points at `yz` (N, 2), mm, and standard deviations `sigma` (N,), mm."""
    return Traces(
        stripes.camera, stripes.plane, stripes.starts, stripes.x, yz, sigma, stripes.normals, stripes.linked, boxes(yz)
    )


def sort_stripes(points_by_camera: Iterable[NDArray[np.void]]) -> Stripes:
    """Sort the points of several cameras (arrays of `POINT_DTYPE`, mm, scanner frame) into stripes.

    Points without finite coordinates are left out. The result does not depend on the order of cameras.

    >>> from footscan.cloud.points import make_points
    >>> xyz = np.array([[0.0, 0.0, 5.0], [0.0, 1.0, 5.0], [0.0, 9.0, 5.0]])
    >>> stripes = sort_stripes([make_points(xyz, camera=2, source=np.arange(3))])
    >>> print(stripes.cameras, stripes.linked)
    [2] [ True False False]
    """
    points = joined(points_by_camera)
    points = points.compress(np.isfinite(points["x"]) & np.isfinite(points["y"]) & np.isfinite(points["z"]))
    cameras, camera = distinct_numbers(points["camera"])
    group = _planes(points["plane"]) * max(len(cameras), 1) + camera
    order = np.lexsort((points["source"], points["frame"], group))
    points, group = points.take(order), group[order]
    planes = int(group[-1]) // len(cameras) + 1 if len(points) else 0
    xyz = coordinates(points)
    yz = np.ascontiguousarray(xyz[:, 1:])
    sigma = points["sigma"].astype(np.float64)
    sigma = np.where(np.isfinite(sigma) & (sigma > 0), np.maximum(sigma, SMALLEST_SIGMA_MM), UNKNOWN_SIGMA_MM)
    linked = np.zeros(len(points), np.bool_)
    linked[:-1] = (np.diff(group) == 0) & (np.diff(points["frame"]) == 0)
    linked[:-1] &= np.hypot(*np.diff(yz, axis=0).T) <= LINK_MM
    normals, bent = _normals(yz, linked)
    return Stripes(
        points=points,
        cameras=cameras,
        camera=camera[order],
        plane=group // max(len(cameras), 1),
        starts=np.searchsorted(group, np.arange(planes * len(cameras) + 1)),
        x=np.ascontiguousarray(xyz[:, 0]),
        yz=yz,
        sigma=sigma,
        linked=linked,
        normals=normals,
        bent=bent,
    )


def boxes(yz: Floats) -> Floats:
    """Compute the bounding box of each block of points (N, 2) and the point that follows it.

    Returns
    -------
    (ceil(N / BLOCK), 4) float64: least Y, greatest Y, least Z, greatest Z, mm.
    """
    starts = np.arange(0, len(yz), BLOCK)
    if not len(starts):
        return np.zeros((0, 4))
    following = np.minimum(starts + BLOCK, len(yz) - 1)
    low = np.minimum(np.minimum.reduceat(yz, starts), yz[following])
    high = np.maximum(np.maximum.reduceat(yz, starts), yz[following])
    return np.column_stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]])


@compiled
def meet(
    point: int,
    first: int,
    last: int,
    reach: float,
    yz: Floats,
    normals: Floats,
    linked: NDArray[np.bool_],
    around: Floats,
) -> tuple[int, float, float]:
    """Intersect the normal of one point with the stripe of the points `first` to `last` - 1, in the plane (Y, Z).

    Returns
    -------
    The point at which the intersected segment of the stripe begins, -1 if there is none within `reach` mm; the place
    on the segment, 0 to 1; and the distance along the normal, mm.
    """
    y, z = yz[point]
    normal_y, normal_z = normals[point]
    nearest, share, distance = -1, 0.0, reach
    for block in range(first // BLOCK, (last - 1) // BLOCK + 1):
        low_y, high_y, low_z, high_z = around[block]
        if y < low_y - reach or y > high_y + reach or z < low_z - reach or z > high_z + reach:
            continue
        start = max(first, block * BLOCK)
        there = (yz[start, 1] - z) * normal_y - (yz[start, 0] - y) * normal_z  # along the stripe of the point
        for k in range(start, min(last - 1, (block + 1) * BLOCK)):
            here, there = there, (yz[k + 1, 1] - z) * normal_y - (yz[k + 1, 0] - y) * normal_z
            if here * there > 0 or here == there or not linked[k]:
                continue
            part = here / (here - there)
            met_y, met_z = yz[k, 0] + part * (yz[k + 1, 0] - yz[k, 0]), yz[k, 1] + part * (yz[k + 1, 1] - yz[k, 1])
            away = (met_y - y) * normal_y + (met_z - z) * normal_z
            if abs(away) > abs(distance) or (nearest >= 0 and abs(away) == abs(distance)):
                continue
            if abs(normals[k, 0] * normal_y + normals[k, 1] * normal_z) < LEAST_COSINE:
                continue
            nearest, share, distance = k, part, away
    return nearest, share, distance


@compiled
def ways_to_neighbours(sample: NDArray[np.intp], reach: float, gap: float, cameras: int, traces: Traces) -> Floats:
    """Find the stripes of the same camera before and after some points.

    Parameters
    ----------
    sample : (M,) indices of the points
    reach, gap : largest distances, mm, along the normal and along X
    cameras : number of all cameras

    Returns
    -------
    (M, 4) distance along the point's normal to the stripe before and X there, then the same of the stripe after, mm;
    NaN from the first of them that is not found.
    """
    camera, plane, starts, x, yz, _, normals, linked, around = traces
    planes = (len(starts) - 1) // cameras
    found = np.full((len(sample), 4), np.nan)
    for row in range(len(sample)):
        n = sample[row]
        for side in range(2):
            near = plane[n] + 2 * side - 1
            while 0 <= near < planes and starts[near * cameras + camera[n]] == starts[near * cameras + camera[n] + 1]:
                near += 2 * side - 1
            if not 0 <= near < planes:
                break
            first, last = starts[near * cameras + camera[n]], starts[near * cameras + camera[n] + 1]
            if abs(x[first] - x[n]) > gap:
                break
            k, share, way = meet(n, first, last, reach, yz, normals, linked, around)
            if k < 0:
                break
            found[row, 2 * side] = way
            found[row, 2 * side + 1] = x[k] + share * (x[k + 1] - x[k])
    return found


def _planes(x: NDArray[np.float32]) -> NDArray[np.intp]:
    """(N,) the number of the laser plane at each X (N,): a plane extends by `PLANE_MM` from its first X."""
    places, place = np.unique(x, return_inverse=True)
    number = np.zeros(len(places), np.intp)
    start = 0
    for k in range(1, len(places)):
        new = places[k] - places[start] > PLANE_MM
        number[k] = number[k - 1] + new
        start = k if new else start
    return np.asarray(number[place])


@compiled
def _normals(yz: Floats, linked: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.bool_]]:
    """(N, 2) normals to the lines from `REACH` points before each point to `REACH` after it, and (N,) corners."""
    normals = np.zeros(yz.shape)
    bent = np.zeros(yz.shape[0], np.bool_)
    for n in range(yz.shape[0]):
        before, after = n, n
        while before > 0 and linked[before - 1] and n - before < REACH:
            before -= 1
        while linked[after] and after - n < REACH:
            after += 1
        along_y, along_z = yz[after, 0] - yz[before, 0], yz[after, 1] - yz[before, 1]
        length = np.sqrt(along_y * along_y + along_z * along_z)
        if length > 0.0:
            normals[n, 0], normals[n, 1] = -along_z / length, along_y / length
            away = (yz[n, 0] - yz[before, 0]) * normals[n, 0] + (yz[n, 1] - yz[before, 1]) * normals[n, 1]
            bent[n] = abs(away) > BENT_MM
    return normals, bent

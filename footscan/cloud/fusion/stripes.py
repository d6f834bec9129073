"""The points of all cameras in the order of laser planes, cameras and stripes, and where stripes meet."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import PLANE_MM, POINT_DTYPE, UNKNOWN_SIGMA_MM, coordinates
from footscan.compiled import compiled

Floats = NDArray[np.float64]

LINK_MM = 1.5
"""Consecutive points of a stripe that are farther apart belong to different pieces of it."""
REACH = 3
"""The stripe runs from so many points before a point to so many after it."""
BENT_MM = 0.15
"""Where a point lies farther from the line through the ends of these, the stripe has a corner."""
BLOCK = 16
"""So many consecutive points share a box, by which what is far away is passed over."""
LEAST_COSINE = 0.85
"""Stripes whose normals differ by more than 32° show different surfaces, or one of them turns a corner."""
SMALLEST_SIGMA_MM = 1e-3


@dataclass(frozen=True)
class Stripes:
    """N points of C cameras in P laser planes, sorted by plane, camera, frame and place along the stripe."""

    points: NDArray[np.void]
    """(N,) of `POINT_DTYPE`."""
    cameras: NDArray[np.intp]
    """(C,) their numbers, ascending."""
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
    """(N,) whether the stripe goes on to the next point."""
    normals: Floats
    """(N, 2) unit normals of the stripes in their planes, of any sign; 0 where a point stands alone."""
    bent: NDArray[np.bool_]
    """(N,) whether the stripe turns a corner."""


class Traces(NamedTuple):
    """What compiled loops take of `Stripes`, with the coordinates and sigmas that hold at the time."""

    camera: NDArray[np.intp]
    plane: NDArray[np.intp]
    starts: NDArray[np.intp]
    x: Floats
    yz: Floats
    sigma: Floats
    normals: Floats
    linked: NDArray[np.bool_]
    around: Floats
    """As `boxes` gives it."""


def traces_of(stripes: Stripes, yz: Floats, sigma: Floats) -> Traces:
    """The stripes with points at `yz` (N, 2), mm, of standard deviations `sigma` (N,), mm."""
    return Traces(
        stripes.camera, stripes.plane, stripes.starts, stripes.x, yz, sigma, stripes.normals, stripes.linked, boxes(yz)
    )


def sort_stripes(points_by_camera: Iterable[NDArray[np.void]]) -> Stripes:
    """The stripes of several clouds of `POINT_DTYPE`; points without finite coordinates are left out.

    The result does not depend on the order of cameras.
    """
    points = np.concatenate([np.empty(0, POINT_DTYPE), *points_by_camera])
    points = points[np.isfinite(points["x"]) & np.isfinite(points["y"]) & np.isfinite(points["z"])]
    cameras, camera = np.unique(points["camera"], return_inverse=True)
    group = _planes(points["x"]) * max(len(cameras), 1) + camera
    order = np.lexsort((points["source"], points["frame"], group))
    points, group = points[order], group[order]
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
        cameras=cameras.astype(np.intp),
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
    """(ceil(N / BLOCK), 4) least and greatest Y, least and greatest Z of each block of points and the next point."""
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
    """Where the normal of one point meets the stripe of the points from `first` to before `last`, in its plane.

    Returns
    -------
    The point at which that stretch of the stripe begins, -1 where there is none within `reach` mm; how far along the
    stretch it lies, 0 to 1; and the distance along the normal, mm.
    """
    y, z = yz[point]
    normal_y, normal_z = normals[point]
    found, share, distance = -1, 0.0, reach
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
            if abs(away) > abs(distance) or (found >= 0 and abs(away) == abs(distance)):
                continue
            if abs(normals[k, 0] * normal_y + normals[k, 1] * normal_z) < LEAST_COSINE:
                continue
            found, share, distance = k, part, away
    return found, share, distance


def _planes(x: NDArray[np.float32]) -> NDArray[np.intp]:
    """(N,) the number of the laser plane of each of (N,) X: from the first on, each reaches as far as `PLANE_MM`."""
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
    """(N, 2) normals to the lines from `REACH` points before each point to `REACH` points behind it, and (N,) bends."""
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

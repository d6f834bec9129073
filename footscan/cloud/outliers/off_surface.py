"""Points off the surface that the stripes around them make: hairs, drops, and mirrors close to the foot.

Such a thing is seen in one frame of one camera, a few millimetres before the skin. The stripes of the neighbouring
frames, and of the other cameras, pass beneath it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.planes import SUMS, add_point, plane_normal
from footscan.cloud.points import PLANE_MM, coordinates
from footscan.compiled import compiled
from footscan.mesh.buckets import Buckets, sort_into_cubes
from footscan.robust import MAD_TO_SD
from footscan.side_by_side import Arrays, in_pieces

JUDGED = 3
"""Every third point of a stripe is judged, for all three: neighbours along a stripe are closer than its width."""
RADIUS_MM = 5.0
"""Radius of the surroundings: holds the stripes before and behind at steps of up to 4 mm. Chosen by hand, as all that
follows, on the film of a drawn foot with hairs in a dark room: two thirds of the points farther than 1 mm from the foot
were dropped, and 0.02 % of those nearer than 0.3 mm."""
FEWEST = 8
"""Points of other stripes from which a plane is fitted; with fewer nothing is dropped."""
SURROUNDING = 3
"""Of them at least so many before, and so many behind."""
LEAST_BREADTH = 0.15
"""Standard deviation of the neighbours across their longest direction, in radii, at least: points of one line, such as
the only other stripe in reach, have no plane."""
MOST = 400
"""Points of other stripes that are used at most: a bound of memory."""
PASSES, INLIER = 3, 3.0
"""Fits of the plane, each to the points within so many standard deviations of the plane before."""
LEAST_SPREAD_MM = 0.05
"""Standard deviation of points on a plane at least: noise of the centres."""
NEAR = 0.25
"""A point is on the surface if it is nearer to the first plane than this share of `LEAST_OFF_MM`, and its neighbours
scatter by less: no further plane is fitted. Chosen by hand."""
OFF, LEAST_OFF_MM = 4.0, 1.0
"""A point is off the surface from this distance on, in standard deviations of its neighbours and in mm. A camera that
is displaced by less stays, so that the fusion finds its contradiction."""
SHARED_RADIUS_MM, SHARED_OFF, LEAST_SHARED_OFF_MM = 4.0, 3.0, 0.6
"""The same for a point that one camera alone saw, near a surface that several cameras saw. In two films of drawn rooms
a quarter to a half of what was farther than 1 mm from the foot was dropped, and 3 to 5 % of the good points that one
camera alone saw, which are 1 to 4 % of the cloud."""


def is_off_surface(points: NDArray[np.void]) -> NDArray[np.bool_]:
    """Select the points (N,) of `POINT_DTYPE` that lie off the surface of the other stripes around them.

    Around a corner or in a cleft the neighbours scatter about their plane, and nothing is dropped.

    >>> from footscan.cloud.points import make_points
    >>> x, y = (part.ravel() for part in np.mgrid[0:12:2, 0:12:0.5])
    >>> z = np.where((x == 6) & (y > 4) & (y < 7), 2.0, 0.0)
    >>> points = make_points(np.column_stack([x, y, z]), camera=1, frame=(x / 2).astype(int), source=np.arange(len(x)))
    >>> print(bool(is_off_surface(points)[z > 0].all()), bool(is_off_surface(points)[(x < 5) & (y < 3)].any()))
    True False
    """
    order = np.lexsort([points["source"], points["frame"], points["camera"]])
    ordered = points.take(order)
    new = np.ones(len(points), np.bool_)
    new[1:] = (np.diff(ordered["frame"]) != 0) | (np.diff(ordered["camera"]) != 0)
    stripe = np.cumsum(new)
    judged = np.flatnonzero((np.arange(len(points)) - np.flatnonzero(new)[stripe - 1]) % JUDGED == 0)
    if not len(judged):
        return np.zeros(len(points), np.bool_)
    places = coordinates(ordered[judged])
    own = stripe[judged].astype(np.int64)
    around = Surroundings(RADIUS_MM, OFF, LEAST_OFF_MM, SURROUNDING)
    off = _off_side_by_side(places, own, places, own, around)
    selected = np.empty(len(points), np.bool_)
    selected[order] = np.repeat(off, np.diff(judged, append=len(points)))
    return selected


def is_off_shared_surface(cloud: NDArray[np.void]) -> NDArray[np.bool_]:
    """Select the points (N,) of a fused cloud that one camera alone saw, off the surface that several cameras saw.

    >>> from footscan.cloud.points import make_points
    >>> x, y = (part.ravel() for part in np.mgrid[0:12:2, 0:12:0.5])
    >>> cloud = make_points(np.column_stack([x, y, np.where((x == 6) & (y == 6), 1.0, 0.0)]), camera=1)
    >>> cloud["cameras"] = np.where((x == 6) & (abs(y - 6) < 2), 1, 3)
    >>> print(np.flatnonzero(is_off_shared_surface(cloud)), np.flatnonzero((x == 6) & (y == 6)))
    [84] [84]
    """
    off = np.zeros(len(cloud), np.bool_)
    alone, shared = np.flatnonzero(cloud["cameras"] == 1), np.flatnonzero(cloud["cameras"] > 1)
    if len(alone) and len(shared):
        known = coordinates(cloud.take(shared))
        places = coordinates(cloud.take(alone))
        # Numbers below 0: what several cameras saw is never of the same stripe.
        own, other = np.arange(len(alone)), np.full(len(shared), -1)
        around = Surroundings(SHARED_RADIUS_MM, SHARED_OFF, LEAST_SHARED_OFF_MM, 0)
        off[alone] = _off_side_by_side(places, own, known, other, around)
    return off


class Surroundings(NamedTuple):
    """What a point is compared with, and from when on it is off."""

    radius_mm: float
    off: float
    """Standard deviations of the neighbours."""
    least_off_mm: float
    surrounding: int
    """Neighbours before the point, and behind it, at least."""


def _off_side_by_side(
    places: NDArray[np.float64],
    stripe: NDArray[np.int64],
    known: NDArray[np.float64],
    known_stripe: NDArray[np.int64],
    around: Surroundings,
) -> NDArray[np.bool_]:
    """As of `_off`."""
    buckets = sort_into_cubes(known, around.radius_mm)

    def off(rows: slice) -> Arrays:
        return (_off(places[rows], stripe[rows], known, known_stripe, buckets, around),)

    return in_pieces(len(places), off)[0]


@compiled
def _off(
    places: NDArray[np.float64],
    stripe: NDArray[np.int64],
    known: NDArray[np.float64],
    known_stripe: NDArray[np.int64],
    buckets: Buckets,
    around: Surroundings,
) -> NDArray[np.bool_]:
    """Select the places (N, 3) that are off the plane of the known ones (M, 3) around them, but for their stripe."""
    off = np.zeros(len(places), np.bool_)
    near, distances = np.empty((MOST, 3)), np.empty(MOST)
    sums = np.empty(SUMS)
    for n in range(len(places)):
        count = _gather(places[n], stripe[n], known, known_stripe, buckets, around.radius_mm, near)
        if count < FEWEST or not _is_surrounded(near[:count], around.surrounding):
            continue
        limit, distance, spread = math.inf, 0.0, 0.0
        distances[:count] = 0.0
        for _ in range(PASSES):
            sums[:] = 0.0
            for k in range(count):
                if distances[k] <= limit:
                    add_point(sums, near[k, 0], near[k, 1], near[k, 2], 1.0)
            a, b, c, _, breadth = plane_normal(sums)
            level = (a * sums[1] + b * sums[2] + c * sums[3]) / sums[0]
            for k in range(count):
                distances[k] = abs(a * near[k, 0] + b * near[k, 1] + c * near[k, 2] - level)
            spread = max(MAD_TO_SD * float(np.median(distances[:count])), LEAST_SPREAD_MM)
            limit = INLIER * spread
            broad = breadth >= (LEAST_BREADTH * around.radius_mm) ** 2
            distance = abs(level) if sums[0] >= FEWEST and broad else 0.0
            if max(abs(level), spread) < NEAR * around.least_off_mm:
                break
        off[n] = distance > max(around.least_off_mm, around.off * spread)
    return off


@compiled
def _is_surrounded(near: NDArray[np.float64], least: int) -> bool:
    """True if there are points before and behind: beyond the last stripe, and on one stripe, a plane says little."""
    before = behind = 0
    for k in range(len(near)):
        before += near[k, 0] < -PLANE_MM
        behind += near[k, 0] > PLANE_MM
    return min(before, behind) >= least


@compiled
def _gather(
    place: NDArray[np.float64],
    own: int,
    known: NDArray[np.float64],
    stripe: NDArray[np.int64],
    buckets: Buckets,
    radius: float,
    near: NDArray[np.float64],
) -> int:
    """Write the known points of other stripes around a place into `near`, relative to it; returns their number."""
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for axis in range(3):
        cell = math.floor((place[axis] - buckets.low[axis]) / buckets.edge)
        low[axis], high[axis] = max(cell - 1, 0), min(cell + 2, buckets.dims[axis])
    count = 0
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            for k in range(low[2], high[2]):
                cube = (i * buckets.dims[1] + j) * buckets.dims[2] + k
                for m in buckets.order[buckets.start[cube] : buckets.start[cube + 1]]:
                    if stripe[m] == own or count == len(near):
                        continue
                    dx, dy, dz = known[m, 0] - place[0], known[m, 1] - place[1], known[m, 2] - place[2]
                    if dx * dx + dy * dy + dz * dz <= radius * radius:
                        near[count, 0], near[count, 1], near[count, 2] = dx, dy, dz
                        count += 1
    return count

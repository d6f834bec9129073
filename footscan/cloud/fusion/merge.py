"""Merging of the stripes of several cameras in one laser plane."""

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.stripes import Floats, Stripes, Traces, meet, traces_of
from footscan.cloud.points import PLANE_MM
from footscan.compiled import compiled
from footscan.side_by_side import together
from schemas.parameters.fusion import FusionParameters

UNSUPPORTED = 1e3
"""Factor on the sigma of points that the calibration does not support: they count only where there are no others."""
BUCKETS = 1 << 18
"""Size of the hash table of grid squares: a bound of memory and time."""
SMALLEST_SPACING_MM, LARGEST_CELL = 1e-3, 1e9
"""Bounds of the spacing and of the number of a grid's columns: numbers of cells stay within 64 bits."""


class Merged(NamedTuple):
    """The points of one cloud."""

    points: NDArray[np.void]
    """(M,) of `POINT_DTYPE`, by plane, then by Y, then by Z."""
    contradicted: dict[int, int]
    """Camera -> the number of its points that were dropped in favour of other cameras."""


def merge(stripes: Stripes, yz: Floats, reach: Floats, deviations: Floats, parameters: FusionParameters) -> Merged:
    """Merge the stripes of all cameras in each laser plane.

    The most certain points are kept, thinned out, and moved along their normals to the weighted mean of all cameras
    there, with weights 1 / sigma^2. There is no averaging along the stripe, which preserves edges. If cameras
    contradict each other, the majority that agrees is kept, and the points of the others are dropped. Without a
    majority all of them count, and the point is as doubtful as they differ: where cameras see the stripes of two lasers
    as one, those that look from ahead err one way, and those from behind the other way. A merged point has the camera,
    frame and source of its most certain point. Its sigma is that of the mean, and larger if the points differ by more
    than their sigmas.

    Parameters
    ----------
    yz : (N, 2) float64, mm, the points after the cameras were moved
    reach : (C,) mm, largest distance at which a camera's stripe counts as the same skin
    deviations : (C, C) mm, standard deviations of the distances between two cameras, by which they may differ without a
        contradiction
    """
    supported = stripes.points["supported"]
    sigma = np.where(supported, stripes.sigma, UNSUPPORTED * stripes.sigma)
    by_sigma, traces = np.argsort(sigma, kind="stable"), traces_of(stripes, yz, sigma)

    def of_planes(of: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.intp], NDArray[np.intp], Floats]:
        order = by_sigma[of[by_sigma]]
        return _merge(order, parameters.spacing_mm, reach, parameters.contradiction_sigmas, deviations, traces)

    half = int(np.searchsorted(stripes.plane, stripes.plane[len(yz) // 2])) if len(yz) else 0
    is_ahead = np.arange(len(yz)) < half
    halves = together([partial(of_planes, is_ahead), partial(of_planes, ~is_ahead)])  # planes are merged separately
    places, surest, cameras, spread = (np.concatenate([a[:half], b[half:]]) for a, b in zip(*halves, strict=True))
    kept = np.flatnonzero(cameras > 0)
    order = kept[np.lexsort((places[kept, 2], places[kept, 1], stripes.plane[kept]))]
    points = stripes.points.take(surest[order])
    points["x"], points["y"], points["z"] = places[order].T
    points["cameras"] = cameras[order]
    points["sigma"] = np.where(points["supported"], spread[order], stripes.sigma[order])
    lost = stripes.camera[cameras < 0]
    contradicted = {int(camera): int(np.count_nonzero(lost == k)) for k, camera in enumerate(stripes.cameras)}
    return Merged(points, contradicted)


@compiled
def _merge(
    by_sigma: NDArray[np.intp],
    spacing: float,
    reach: Floats,
    sigmas: float,
    deviations: Floats,
    traces: Traces,
) -> tuple[Floats, NDArray[np.intp], NDArray[np.intp], Floats]:
    """Merge the points in the order `by_sigma`.

    Returns
    -------
    places : (N, 3), where each point is moved to, mm.
    surest : (N,), the most certain point of those that it is made of.
    members : (N,), the number of cameras that agree on it; 0 if it is thinned out, -1 if it is contradicted.
    spread : (N,), its standard deviation, mm.
    """
    _, plane, _, x, yz, sigma, normals, _, _ = traces
    count = yz.shape[0]
    cameras = deviations.shape[0]
    places, surest = np.empty((count, 3)), np.arange(count)
    members, spread = np.zeros(count, np.intp), sigma.copy()
    table = np.full(BUCKETS, -1, np.intp)  # the last kept point of each bucket
    previous = np.full(count, -1, np.intp)
    sights, seen_by = np.empty((cameras, 3)), np.empty((cameras, 2), np.intp)
    agreeing = np.zeros(cameras, np.bool_)
    for n in by_sigma:
        places[n, 0], places[n, 1], places[n, 2] = x[n], yz[n, 0], yz[n, 1]
        if not _is_free(plane[n], yz[n], spacing, plane, places, table, previous):
            continue
        seen = _look(n, reach, traces, sights, seen_by)
        agree = _vote(seen, sights, seen_by, sigmas, deviations, agreeing)
        is_undecided = 2 * agree <= seen
        if is_undecided:
            sights[:seen, 2] += (0.5 * np.ptp(sights[:seen, 0])) ** 2
            agreeing[:seen] = True
        counted, weight, away, ahead, squares, most = 0, 0.0, 0.0, 0.0, 0.0, 0.0
        contradicted = True
        for m in range(seen):
            if agreeing[m]:
                contradicted &= seen_by[m, 1] != n
                own_weight = 1.0 / sights[m, 2]
                counted, weight = counted + 1, weight + own_weight
                away += own_weight * sights[m, 0]
                ahead += own_weight * sights[m, 1]
                squares += own_weight * sights[m, 0] ** 2
                if own_weight > most:
                    most, surest[n] = own_weight, seen_by[m, 1]
        if contradicted:
            members[n] = -1
            continue
        # The sigma of the mean grows with the scatter (R. T. Birge, Physical Review 40, 1932,
        # doi:10.1103/PhysRev.40.207).
        mean = away / weight
        ratio = (squares - mean**2 * weight) / max(counted - 1, 1)
        spread[n] = np.sqrt(max(1.0, ratio) / weight)
        places[n, 0] += ahead / weight
        places[n, 1] += mean * normals[n, 0]
        places[n, 2] += mean * normals[n, 1]
        if _is_free(plane[n], places[n, 1:], spacing, plane, places, table, previous):
            members[n] = 1 if is_undecided else agree
            bucket = _bucket(plane[n], _cell(places[n, 1], spacing), _cell(places[n, 2], spacing))
            previous[n] = table[bucket]
            table[bucket] = n
    return places, surest, members, spread


@compiled
def _look(
    n: int,
    reach: Floats,
    traces: Traces,
    sights: Floats,
    seen_by: NDArray[np.intp],
) -> int:
    """Count the cameras that see the skin of point `n`: its own, and those whose stripe its normal meets.

    Fills, for each of them, `sights` with the distance along the normal and in X, mm, and the variance of the former,
    mm^2; and `seen_by` with the camera and its nearest point.
    """
    camera, plane, starts, x, yz, sigma, normals, linked, around = traces
    cameras = len(reach)
    seen = 0
    for b in range(cameras):
        if b == camera[n]:
            sights[seen, 0], sights[seen, 1], sights[seen, 2] = 0.0, 0.0, sigma[n] ** 2
            seen_by[seen, 0], seen_by[seen, 1] = b, n
            seen += 1
            continue
        first, last = starts[plane[n] * cameras + b], starts[plane[n] * cameras + b + 1]
        within = max(reach[b], reach[camera[n]])
        k, share, distance = meet(n, first, last, within, yz, normals, linked, around)
        # In planes that are turned against each other it may be other skin.
        if k >= 0 and abs(x[k] - x[n]) <= PLANE_MM:
            sights[seen, 0], sights[seen, 1] = distance, x[k] - x[n]
            sights[seen, 2] = (1 - share) * sigma[k] ** 2 + share * sigma[k + 1] ** 2
            seen_by[seen, 0], seen_by[seen, 1] = b, k if share < 0.5 else k + 1
            seen += 1
    return seen


@compiled
def _vote(
    seen: int,
    sights: Floats,
    seen_by: NDArray[np.intp],
    sigmas: float,
    deviations: Floats,
    agreeing: NDArray[np.bool_],
) -> int:
    """Mark in `agreeing` the largest (or most certain) group of sights that agree; returns its size."""
    best, best_count, best_weight = 0, 0, 0.0
    for k in range(seen):
        count, weight = 0, 0.0
        for m in range(seen):
            if _agree(k, m, sights, seen_by, sigmas, deviations):
                count += 1
                weight += 1.0 / sights[m, 2]
        if count > best_count or (count == best_count and weight > best_weight):
            best, best_count, best_weight = k, count, weight
    for m in range(seen):
        agreeing[m] = _agree(best, m, sights, seen_by, sigmas, deviations)
    return best_count


@compiled
def _agree(k: int, m: int, sights: Floats, seen_by: NDArray[np.intp], sigmas: float, deviations: Floats) -> bool:
    """True if two sights agree. Between planes that differ in X, the skin may slope by 45 degrees."""
    apart = abs(sights[k, 0] - sights[m, 0]) - abs(sights[k, 1] - sights[m, 1])
    variance = sights[k, 2] + sights[m, 2] + deviations[seen_by[k, 0], seen_by[m, 0]] ** 2
    return bool(k == m or apart <= sigmas * np.sqrt(variance))


@compiled
def _is_free(
    of_plane: int,
    yz: Floats,
    spacing: float,
    plane: NDArray[np.intp],
    places: Floats,
    table: NDArray[np.intp],
    previous: NDArray[np.intp],
) -> bool:
    """True if no kept point of the plane is nearer than `spacing`."""
    if spacing <= 0.0:
        return True
    column, row = _cell(yz[0], spacing), _cell(yz[1], spacing)
    for neighbour in range(9):
        k = table[_bucket(of_plane, column + neighbour // 3 - 1, row + neighbour % 3 - 1)]
        while k >= 0:
            if plane[k] == of_plane and (places[k, 1] - yz[0]) ** 2 + (places[k, 2] - yz[1]) ** 2 < spacing**2:
                return False
            k = previous[k]
    return True


@compiled
def _cell(place: float, spacing: float) -> int:
    """The column or row of a place in the grid, limited to +-`LARGEST_CELL`, far beyond any foot."""
    return int(min(max(np.floor(place / max(spacing, SMALLEST_SPACING_MM)), -LARGEST_CELL), LARGEST_CELL))


@compiled
def _bucket(plane: int, column: int, row: int) -> int:
    """The bucket of a grid square: a hash by three large primes (M. Teschner et al., "Optimized spatial hashing for
    collision detection of deformable objects", Vision, Modeling and Visualization, 2003).
    """
    return (plane * 83492791 ^ column * 73856093 ^ row * 19349663) % BUCKETS

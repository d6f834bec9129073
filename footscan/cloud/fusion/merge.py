"""The stripes of several cameras in one laser plane to one."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.stripes import Floats, Stripes, Traces, meet, traces_of
from footscan.compiled import compiled
from schemas.parameters.fusion import FusionParameters

UNSUPPORTED = 1e3
"""Points without support by the calibration count as if so many times less sure: only where nothing else is."""
BUCKETS = 1 << 18
"""Of the table of places, by squares of the grid."""


class Merged(NamedTuple):
    """The points of one cloud."""

    points: NDArray[np.void]
    """(M,) of `POINT_DTYPE`, by plane, then by Y, then by Z."""
    contradicted: dict[int, int]
    """How many points of each camera gave way to those of others."""


def merge(stripes: Stripes, yz: Floats, reach: Floats, deviations: Floats, parameters: FusionParameters) -> Merged:
    """The surest points, thinned out, each moved along its normal to the mean of what all cameras see there.

    Nothing is averaged along the stripe, so that edges stay. Weights are 1 / sigma^2. Where cameras contradict each
    other, those stay that most others agree with, of as many the surest; the points of the others are dropped. Camera,
    frame and source are those of the surest one. Its sigma is that of the mean, the larger the farther its parts lie
    apart.

    Parameters
    ----------
    yz : (N, 2) mm, the points after the cameras were moved
    reach : (C,) mm, how far from its own place a camera may see what others see
    deviations : (C, C) standard deviations of the cameras' distances from each other, mm; by these they differ without
        contradicting each other
    """
    supported = stripes.points["supported"]
    sigma = np.where(supported, stripes.sigma, UNSUPPORTED * stripes.sigma)
    places, surest, cameras, spread = _merge(
        np.argsort(sigma, kind="stable"),
        parameters.spacing_mm,
        reach,
        parameters.contradiction_sigmas,
        deviations,
        traces_of(stripes, yz, sigma),
    )
    kept = np.flatnonzero(cameras > 0)
    order = kept[np.lexsort((places[kept, 2], places[kept, 1], stripes.plane[kept]))]
    points = stripes.points[surest[order]]
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
    """Where each point moves to, (N, 3); the surest of those that it is made of; of how many cameras, 0 where it is
    thinned out and -1 where it is contradicted; and its standard deviation."""
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
        agree, weight = _vote(seen, sights, seen_by, sigmas, deviations, agreeing)
        mean = mean_x = most = squares = 0.0
        contradicted = True
        for m in range(seen):
            if agreeing[m]:
                contradicted &= seen_by[m, 1] != n
                away, ahead, own_weight = sights[m, 0], sights[m, 1], 1.0 / sights[m, 2]
                mean += away * own_weight / weight
                mean_x += ahead * own_weight / weight
                squares += away**2 * own_weight
                if own_weight > most:
                    most, surest[n] = own_weight, seen_by[m, 1]
        if contradicted:
            members[n] = -1
            continue
        # R. T. Birge, Physical Review 40 (1932) 207-227: what does not agree is less sure than it says.
        ratio = (squares - mean**2 * weight) / max(agree - 1, 1)
        spread[n] = np.sqrt(max(1.0, ratio) / weight)
        places[n, 0] += mean_x
        places[n, 1] += mean * normals[n, 0]
        places[n, 2] += mean * normals[n, 1]
        if _is_free(plane[n], places[n, 1:], spacing, plane, places, table, previous):
            members[n] = agree
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
    """How many cameras see what point `n` does: its own, and those whose stripe its normal meets.

    Filled in are, by camera, `sights`, how far along the normal and in X it sees it, mm, and the variance of that,
    mm^2; and `seen_by`, the camera and its nearest point.
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
        if k >= 0:
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
) -> tuple[int, float]:
    """Fills in which sights agree with the one that most do, of as many the surest; how many, and their weight."""
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
    return best_count, best_weight


@compiled
def _agree(k: int, m: int, sights: Floats, seen_by: NDArray[np.intp], sigmas: float, deviations: Floats) -> bool:
    """Whether two sights are of the same; where their planes are not quite one, the skin may slope by 45 degrees."""
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
    """Whether no kept point of the plane is nearer than `spacing`."""
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
    """The column or row of a grid; far beyond any foot, where numbers might not fit, all is one."""
    return int(min(max(np.floor(place / max(spacing, 1e-3)), -1e9), 1e9))


@compiled
def _bucket(plane: int, column: int, row: int) -> int:
    """The place in the table of a square of the grid, by three large primes."""
    return (plane * 83492791 ^ column * 73856093 ^ row * 19349663) % BUCKETS

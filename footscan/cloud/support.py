"""Segments of stripe that nothing supports: none before and behind them, or no camera that should see them."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import coordinates, stripe_step
from footscan.cloud.segments import segments_of
from footscan.cloud.views import View
from footscan.cloud.visibility import CONFIRMED, DENIED, ask_others, cameras_near, sight_of
from footscan.compiled import compiled
from footscan.mesh.voxels import EMPTY, Voxels, voxelise
from schemas.parameters.outliers import OutlierParameters

Ints = NDArray[np.int32]

CELL_MM = 1.0
"""Cells across the travel: other cameras' points count as the same within about 1.5 of them."""
PLANES_MM = 2.0
"""Cells along the travel are as long as its steps are, but not shorter than this."""
PLANES = 3
"""How many cells before and behind a segment are searched for others."""
END_REACH = 3
"""The first stripes of heel and toes, with nothing on their other side, are so many times farther apart than others."""

SUPPORTED, END, ISOLATED, UNCONFIRMED = range(4)


def judge_segments(
    points: NDArray[np.void], views: Mapping[int, View], parameters: OutlierParameters
) -> NDArray[np.uint8]:
    """`SUPPORTED`, `END`, `ISOLATED` or `UNCONFIRMED` for each of `points` (N,) of `POINT_DTYPE`, N >= 1, all finite.

    Points of one segment are judged alike, so that a gap in another camera's stripe costs nothing; but at the ends of a
    stripe, whose last pixels see half of it, points are given up for what other cameras see there within theirs.
    """
    segment, from_end = segments_of(points, parameters.gap_mm, parameters.segment_mm)
    size = np.bincount(segment)
    xyz, step = coordinates(points), stripe_step(points)
    voxels = voxelise(xyz, (max(step, PLANES_MM), CELL_MM, CELL_MM))
    ids = np.unique(points["camera"])
    camera = np.searchsorted(ids, points["camera"]).astype(np.uint8)
    sight = sight_of(xyz, camera, len(ids), voxels)
    answers = ask_others(xyz, camera, voxels.voxel, [views.get(int(one)) for one in ids], voxels, sight)
    confirmed, denied = (np.bincount(segment, answers == answer, len(size)) for answer in (CONFIRMED, DENIED))

    suspect = confirmed <= parameters.confirmed_share * size
    verdict = np.full(len(size), SUPPORTED, np.uint8)
    if len(ids) >= parameters.fewest_cameras:
        verdict[suspect & (denied > parameters.denied_share * size)] = UNCONFIRMED
    if step > 0:
        beside = _count_beside(segment, suspect, parameters.beside_mm, voxels)
        verdict[suspect & (beside < parameters.beside_share * size)] = ISOLATED
    verdict[(size < parameters.shortest) & (confirmed == 0)] = ISOLATED
    verdicts = verdict[segment]
    is_end = from_end < parameters.end_points
    verdicts[_covered(is_end, camera, voxels.number, voxels.voxel, voxels.place) & (verdicts == SUPPORTED)] = END
    return np.asarray(verdicts)


@compiled
def _covered(
    is_end: NDArray[np.bool_], camera: NDArray[np.uint8], number: Ints, voxel: Ints, place: Ints
) -> NDArray[np.bool_]:
    """Which of the points at an end have others near them that are at none, of another camera."""
    within = np.zeros(len(place), np.uint64)
    for n in range(len(voxel)):
        if not is_end[n]:
            within[voxel[n]] |= np.uint64(1) << np.uint64(camera[n])
    covered = np.zeros(len(voxel), np.bool_)
    for n in range(len(voxel)):
        if is_end[n]:
            others = ~(np.uint64(1) << np.uint64(camera[n]))
            covered[n] = cameras_near(number, within, place[voxel[n]]) & others != 0
    return covered


def _count_beside(segment: Ints, suspect: NDArray[np.bool_], beside_mm: float, voxels: Voxels) -> NDArray[np.int64]:
    """(S,) how many points of each suspect segment have others before or behind them."""
    reach = max(round(beside_mm / voxels.size[1]), 1)
    return np.asarray(_search(segment, suspect, reach, voxels.number, voxels.voxel, voxels.place))


@compiled
def _search(
    segment: Ints, suspect: NDArray[np.bool_], reach: int, number: Ints, voxel: Ints, place: Ints
) -> NDArray[np.int64]:
    beside = np.zeros(len(suspect), np.int64)
    for n in range(len(segment)):
        s = segment[n]
        if not suspect[s]:
            continue
        at = place[voxel[n]]
        is_beside = _occupied(at, -1, reach, number) or _occupied(at, 1, reach, number)
        wide = END_REACH * reach
        if is_beside or _occupied(at, -1, wide, number) != _occupied(at, 1, wide, number):
            beside[s] += 1
    return beside


@compiled
def _occupied(place: Ints, side: int, reach: int, number: Ints) -> bool:
    """Whether cells up to `reach` from a place, in Y and Z, hold points in the planes on one side of it."""
    _, columns, rows = number.shape
    for away in range(1, PLANES + 1):
        for b in range(max(place[1] - reach, 0), min(place[1] + reach + 1, columns)):
            for c in range(max(place[2] - reach, 0), min(place[2] + reach + 1, rows)):
                if number[place[0] + side * away, b, c] != EMPTY:
                    return True
    return False

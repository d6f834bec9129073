"""Verdicts on segments of stripe: supported, isolated along the travel, or not confirmed by other cameras."""

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.cell_cameras import cameras_near
from footscan.cloud.outliers.segments import segments_of
from footscan.cloud.outliers.visibility import CONFIRMED, DENIED, ask_others, sight_of
from footscan.cloud.points import coordinates, stripe_step
from footscan.cloud.views import View
from footscan.compiled import compiled
from footscan.mesh.voxels import EMPTY, Voxels, voxelise
from schemas.parameters.outliers import OutlierParameters

Ints = NDArray[np.int32]

CELL_MM = 1.0
"""Side of the cells across the travel: points of two cameras count as the same within about 1.5 cells. Chosen by
hand."""
PLANES_MM = 2.0
"""Least length of the cells along the travel; they are as long as its steps if these are longer. Chosen by hand."""
PLANES = 3
"""Cells before and behind a segment that are searched for other points. Chosen by hand."""
END_REACH = 3
"""Factor on the search distance for the first stripes of heel and toes, which have points on one side only and are
farther apart than others. Chosen by hand."""

DENIED_AT_ALL = 0.1
"""Share of a piece's points that other cameras deny from which the piece is in doubt. Chosen by hand."""

CLUTTER_CONFIRMED = 0.5
"""Share of a segment that other cameras must confirm, if its camera sees much that is not the foot. Chosen by hand."""
SUPPORTED, END, ISOLATED, UNCONFIRMED = range(4)
"""The verdicts on a point."""


def judge_segments(
    points: NDArray[np.void],
    views: Mapping[int, View],
    parameters: OutlierParameters,
    filmed: Mapping[int, NDArray[np.float64]] | None = None,
    cluttered: Collection[int] = (),
) -> NDArray[np.uint8]:
    """Judge the segments of stripe.

    All points of a segment get the same verdict, so that a gap in another camera's stripe does no harm; and a piece of
    stripe is dropped as a whole if it is alone. The exception
    is the end of a stripe, where the last pixels see only a part of its width: points there are given up if another
    camera sees the place within its stripe.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, N >= 1, mm, scanner frame, all finite
    views : camera -> view, of the cameras whose position is known
    filmed : camera -> X of its frames, mm; where a camera is missing, only frames with points count as filmed
    cluttered : cameras that see much that is not the foot: their stripes need confirmation

    Returns
    -------
    (N,) uint8: `SUPPORTED`, `END`, `ISOLATED` or `UNCONFIRMED`.
    """
    segment, from_end = segments_of(points, parameters.gap_mm, parameters.segment_mm)
    size = np.bincount(segment)
    xyz, step = coordinates(points), stripe_step(points)
    voxels = voxelise(xyz, (max(step, PLANES_MM), CELL_MM, CELL_MM))
    camera_numbers = np.unique(points["camera"])
    camera = np.searchsorted(camera_numbers, points["camera"]).astype(np.uint8)
    frames = [(filmed or {}).get(int(number)) for number in camera_numbers]
    sight = sight_of(xyz, camera, frames, voxels)
    answers = ask_others(
        xyz, camera, voxels.voxel, [views.get(int(number)) for number in camera_numbers], voxels, sight
    )
    confirmed, denied = (np.bincount(segment, answers == answer, len(size)) for answer in (CONFIRMED, DENIED))

    suspect = confirmed <= parameters.confirmed_share * size
    verdict = np.full(len(size), SUPPORTED, np.uint8)
    if len(camera_numbers) >= parameters.fewest_cameras:
        verdict[suspect & (denied > parameters.denied_share * size)] = UNCONFIRMED
        piece, _ = segments_of(points, parameters.gap_mm, np.inf)
        in_clutter = np.isin(camera_numbers, list(cluttered))[camera]
        alone = _is_alone(piece, answers, in_clutter, parameters)
        verdict[np.bincount(segment, alone) > 0] = UNCONFIRMED
        verdict[(np.bincount(segment, in_clutter) > 0) & (confirmed < CLUTTER_CONFIRMED * size)] = UNCONFIRMED
    if step > 0:
        beside = _count_beside(segment, suspect, parameters.beside_mm, voxels)
        verdict[suspect & (beside < parameters.beside_share * size)] = ISOLATED
    verdict[(size < parameters.shortest) & (confirmed == 0)] = ISOLATED
    verdicts = verdict[segment]
    is_end = from_end < parameters.end_points
    verdicts[_covered(is_end, camera, voxels.number, voxels.voxel, voxels.place) & (verdicts == SUPPORTED)] = END
    return np.asarray(verdicts)


def _is_alone(
    piece: Ints, answers: NDArray[np.uint8], in_clutter: NDArray[np.bool_], parameters: OutlierParameters
) -> NDArray[np.bool_]:
    """Select the points (N,) of pieces that hardly another camera confirms, or that more points deny than confirm.

    in_clutter : (N,) True for points of cameras that see much that is not the foot. Of other cameras, pieces that
        nobody denies are kept: with cameras missing, they may be the only sight of the skin.
    """
    length = np.bincount(piece)
    confirmed, denied = (np.bincount(piece, answers == answer) / length for answer in (CONFIRMED, DENIED))
    is_denied = denied > DENIED_AT_ALL
    alone = (confirmed <= parameters.confirmed_share)[piece] & (is_denied[piece] | in_clutter)
    return np.asarray(alone | (is_denied & (denied >= confirmed))[piece])


@compiled
def _covered(
    is_end: NDArray[np.bool_], camera: NDArray[np.uint8], number: Ints, voxel: Ints, place: Ints
) -> NDArray[np.bool_]:
    """Select the points at an end of a stripe that are near points of another camera within its stripe."""
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
    """(S,) the number of points of each suspect segment that have others before or behind them; 0 for the rest."""
    reach = max(round(beside_mm / voxels.size[1]), 1)
    return np.asarray(_search(segment, suspect, reach, voxels.number, voxels.voxel, voxels.place))


@compiled
def _search(
    segment: Ints, suspect: NDArray[np.bool_], reach: int, number: Ints, voxel: Ints, place: Ints
) -> NDArray[np.int64]:
    """Count the points as in `_count_beside`, with a search distance of `reach` cells."""
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
    """True if cells within `reach` of a place in Y and Z hold points, in the planes on one side of it."""
    _, columns, rows = number.shape
    for away in range(1, PLANES + 1):
        for b in range(max(place[1] - reach, 0), min(place[1] + reach + 1, columns)):
            for c in range(max(place[2] - reach, 0), min(place[2] + reach + 1, rows)):
                if number[place[0] + side * away, b, c] != EMPTY:
                    return True
    return False

"""Points that are not the foot's, by what they come from."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.clutter import is_island, is_static
from footscan.cloud.plate import is_plate
from footscan.cloud.support import END, ISOLATED, UNCONFIRMED, judge_segments
from footscan.cloud.views import View
from schemas.parameters.outliers import OutlierParameters

Mask = NDArray[np.bool_]

REASONS = ("volume", "extrapolated", "end", "isolated", "unconfirmed", "glass", "clutter")
"""What points are dropped for; the code of a reason is its place here, counted from 1."""
KEPT = 0


@dataclass(frozen=True)
class Removed:
    """What was dropped, and why."""

    codes: NDArray[np.uint8]
    """(N,): for each point that went in `KEPT`, or the code of its reason."""
    counts: dict[int, dict[str, int]]
    """Camera -> reason -> how many: all reasons of each camera that has points."""


def remove_outliers(
    points: NDArray[np.void], views: Mapping[int, View], parameters: OutlierParameters
) -> tuple[NDArray[np.void], Removed]:
    """The points that can be the foot's, in their order, and which others there were.

    What is outside the control volume ("volume") and what the calibration does not support ("extrapolated") is dropped
    first; then the foot's mirror image and the glass itself ("glass"), and what stands there without the foot
    ("clutter"), for they would speak for each other; then segments of stripe without any before and behind them
    ("isolated"), those that other cameras should see, and do not ("unconfirmed"), and the last points of a stripe where
    other cameras see the same place within theirs ("end"); at last what is small and apart from the rest ("clutter"
    again).

    Parameters
    ----------
    points : (N,) array of `POINT_DTYPE`, mm, scanner frame: of all cameras, as they saw them
    views : where the cameras stand, as far as that is known; nobody is asked to confirm what another camera saw unless
        his place is
    """
    codes = np.zeros(len(points), np.uint8)

    def mark(reason: str, dropped: NDArray[np.intp]) -> None:
        codes[dropped] = 1 + REASONS.index(reason)

    def left() -> NDArray[np.intp]:
        return np.flatnonzero(codes == KEPT)

    mark("volume", np.flatnonzero(_outside(points, parameters)))
    if parameters.drop_unsupported:
        mark("extrapolated", left()[~points["supported"][left()]])
    if (inside := left()).size:
        mark("glass", inside[is_plate(points[inside], views, parameters.glass_mm)])
    if (inside := left()).size:
        mark("clutter", inside[is_static(points[inside], parameters.static_share)])
    if (inside := left()).size:
        verdicts = judge_segments(points[inside], views, parameters)
        mark("end", inside[verdicts == END])
        mark("isolated", inside[verdicts == ISOLATED])
        mark("unconfirmed", inside[verdicts == UNCONFIRMED])
    if (inside := left()).size:
        mark("clutter", inside[is_island(points[inside], parameters.island_gap_steps, parameters.island_share)])
    return points[codes == KEPT], Removed(codes, _count(points["camera"], codes))


def _outside(points: NDArray[np.void], parameters: OutlierParameters) -> Mask:
    inside = np.ones(len(points), np.bool_)
    for axis, (low, high) in (("x", parameters.x_mm), ("y", parameters.y_mm), ("z", parameters.z_mm)):
        inside &= (points[axis] >= low) & (points[axis] <= high)  # false for NaN
    return ~inside


def _count(camera: NDArray[np.uint8], codes: NDArray[np.uint8]) -> dict[int, dict[str, int]]:
    counts = np.zeros((256, len(REASONS) + 1), np.int64)
    np.add.at(counts, (camera, codes), 1)
    return {
        int(one): {reason: int(counts[one, code]) for code, reason in enumerate(REASONS, start=1)}
        for one in np.unique(camera)
    }

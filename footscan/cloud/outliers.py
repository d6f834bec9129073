"""Removal of the points that do not belong to the foot, by reason."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.clutter import is_island, is_static
from footscan.cloud.glass import is_plate
from footscan.cloud.support import END, ISOLATED, UNCONFIRMED, judge_segments
from footscan.cloud.views import View
from schemas.parameters.outliers import OutlierParameters

Mask = NDArray[np.bool_]

REASONS = ("volume", "extrapolated", "end", "isolated", "unconfirmed", "glass", "clutter")
"""Reasons to drop a point; the code of a reason is its position here, counted from 1."""
KEPT = 0
"""Code of a point that is kept."""


@dataclass(frozen=True)
class Removed:
    """The points that were dropped, and their reasons."""

    codes: NDArray[np.uint8]
    """(N,): `KEPT` or the code of the reason, for each input point."""
    counts: dict[int, dict[str, int]]
    """Camera -> reason -> number of points; all reasons, for each camera that has points."""


def remove_outliers(
    points: NDArray[np.void], views: Mapping[int, View], parameters: OutlierParameters
) -> tuple[NDArray[np.void], Removed]:
    """Drop the points that cannot belong to the foot.

    They are dropped in this order:

    - points outside the control volume ("volume"), and points that the calibration does not support ("extrapolated");
    - the foot's mirror image and the glass itself ("glass"), then static objects ("clutter"): they would confirm each
      other;
    - the last points of a stripe where other cameras see the same place within their stripes ("end"), segments of
      stripe without any before and behind them ("isolated"), and segments that other cameras should see, but do not
      ("unconfirmed");
    - small parts apart from the rest ("clutter" again).

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, mm, scanner frame, of all cameras
    views : camera -> view; only cameras listed here are expected to confirm what another camera saw

    Returns
    -------
    The points that are kept, in their order, and a report of the others.

    Examples
    --------
    >>> from footscan.cloud.points import make_points
    >>> points = make_points(np.array([[0.0, 0.0, 1e6]]), camera=3)
    >>> kept, removed = remove_outliers(points, {}, OutlierParameters())
    >>> print(len(kept), removed.counts[3]["volume"])
    0 1
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
    cameras, index = np.unique(camera, return_inverse=True)
    counts = np.zeros((len(cameras), len(REASONS) + 1), np.int64)
    np.add.at(counts, (index, codes), 1)
    return {
        int(number): dict(zip(REASONS, of_camera[1:].tolist(), strict=True))
        for number, of_camera in zip(cameras, counts, strict=True)
    }

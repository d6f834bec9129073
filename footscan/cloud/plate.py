"""The glass plate that the foot stands on, where its own stripe shows, and what mirrors in it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import PLANE_MM, stripe_step
from footscan.cloud.views import View

HIGH_MM = 5.0
"""Points so far above the glass are those of the foot's sides."""
FEWEST_HIGH = 10
"""So many of them in a plane tell how broad the foot is there."""
FEWEST_PLANES = 5
"""In so many planes, for else only the sole was seen."""
BESIDE_MM = 5.0
"""The sole reaches no farther out than the sides do, or not by more than this."""
AHEAD_PLANES = 2
"""Nor farther along the travel than so many planes."""


def is_plate(points: NDArray[np.void], views: Mapping[int, View], glass_mm: float) -> NDArray[np.bool_]:
    """Which `points` (N,) of `POINT_DTYPE`, N >= 1, all finite, lie below the glass at Z = 0, or in it, mm.

    Below is what is farther below than `glass_mm`: a mirror image. In it lies what is no farther from it than that, but
    stands beside, before or behind the sides of the foot. What is beside them is known where cameras above the glass
    see both.
    """
    z = points["z"]
    below: NDArray[np.bool_] = z < -glass_mm
    step = max(stripe_step(points), PLANE_MM)
    above = [views[camera].centre for camera in np.unique(points["camera"]) if camera in views]
    sides_seen = {np.sign(centre[1]) for centre in above if centre[2] > 0}
    if not {-1.0, 1.0} <= sides_seen:
        return below
    plane = np.round((points["x"] - points["x"].min()) / step).astype(np.int64)
    sides = _sides(plane, points["y"], z > HIGH_MM)
    if sides is None:
        return below
    low, high = sides
    y = points["y"]
    beside = (y < low[plane] - BESIDE_MM) | (y > high[plane] + BESIDE_MM)
    return np.asarray(below | (beside & (np.abs(z) <= glass_mm)))


def _sides(
    plane: NDArray[np.int64], y: NDArray[np.float32], is_high: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Least and greatest Y (P,) of the high points about each plane; None where too few planes have any.

    A plane between others without high points of its own has those of the next before and behind it; beyond the first
    and the last, where nothing stands, the least is infinite.
    """
    planes = int(plane.max()) + 1
    low, high = np.full(planes, np.inf), np.full(planes, -np.inf)
    np.minimum.at(low, plane[is_high], y[is_high])
    np.maximum.at(high, plane[is_high], y[is_high])
    known = np.flatnonzero(np.bincount(plane[is_high], minlength=planes) >= FEWEST_HIGH)
    if len(known) < FEWEST_PLANES:
        return None
    every = np.arange(planes)
    place = np.searchsorted(known, every)
    before = known[np.maximum(np.searchsorted(known, every, side="right") - 1, 0)]
    behind = known[np.minimum(place, len(known) - 1)]
    low, high = np.minimum(low[before], low[behind]), np.maximum(high[before], high[behind])
    nothing = (every < known[0] - AHEAD_PLANES) | (every > known[-1] + AHEAD_PLANES)
    low[nothing], high[nothing] = np.inf, -np.inf
    return low, high

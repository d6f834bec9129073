"""Points of the glass plate that the foot stands on, and of the foot's mirror image in it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import PLANE_MM, stripe_step
from footscan.cloud.views import View

HIGH_MM = 5.0
"""Height above the glass from which points belong to the foot's sides. Chosen by hand."""
FEWEST_HIGH = 10
"""High points in a plane from which the width of the foot is known there. Chosen by hand."""
FEWEST_PLANES = 5
"""Planes with known width from which the sides count as seen; with fewer only the sole was seen. Chosen by hand."""
BESIDE_MM = 5.0
"""Distance by which the sole may reach beyond the sides in Y. Chosen by hand."""
AHEAD_PLANES = 2
"""Planes by which the sole may reach beyond the sides along the travel. Chosen by hand."""
BIN_MM = 2.0
"""Width in Y of the strips in which the sole is either on the glass or above it. Chosen by hand."""
SOLE_MM = (2.0, 40.0)
"""Heights of a sole that does not touch the glass: on the border of what does, it rises by less within a strip; above,
there are no soles. Chosen by hand."""


def is_plate(points: NDArray[np.void], views: Mapping[int, View], glass_mm: float) -> NDArray[np.bool_]:
    """Select the points that lie below the glass or in it.

    Points more than `glass_mm` below it are a mirror image. Points within `glass_mm` of it are in the glass if they lie
    beside, before or behind the sides of the foot. The latter are dropped only if cameras above the glass see both
    sides of the foot.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, N >= 1, mm, all finite, with heights above the glass for Z, as of `above_glass`
    views : camera -> view, mm

    Returns
    -------
    (N,) bool.

    Examples
    --------
    >>> from footscan.cloud.points import make_points
    >>> print(is_plate(make_points(np.array([[0, 0, -20.0], [0, 0, 20.0]]), camera=1), {}, glass_mm=2.0))
    [ True False]
    """
    z = points["z"]
    below: NDArray[np.bool_] = z < -glass_mm
    above = [views[camera].centre for camera in np.unique(points["camera"]) if camera in views]
    sides_seen = {np.sign(centre[1]) for centre in above if centre[2] > 0}
    if not {-1.0, 1.0} <= sides_seen:
        return below
    plane = _planes(points)
    sides = _sides(plane, points["y"].astype(np.float64), z > HIGH_MM)
    if sides is None:
        return below
    low, high = sides
    y = points["y"]
    beside = (y < low[plane] - BESIDE_MM) | (y > high[plane] + BESIDE_MM)
    return np.asarray(below | (beside & (np.abs(z) <= glass_mm)))


def is_below_sole(points: NDArray[np.void], views: Mapping[int, View], glass_mm: float) -> NDArray[np.bool_]:
    """Select the points of the glass below a sole that does not touch it: water, dust or a fingerprint shines there.

    They lie within `glass_mm` of it, in strips of planes in which two cameras below the glass see the sole above.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, N >= 1, mm, all finite, without ghosts, with heights above the glass for Z
    views : camera -> view, mm

    Returns
    -------
    (N,) bool.
    """
    plane = _planes(points)
    strip = np.floor((points["y"] - points["y"].min()) / BIN_MM).astype(np.int64)
    cameras = np.zeros((int(plane.max()) + 1, int(strip.max()) + 1), np.int64)
    is_sole = (points["z"] > SOLE_MM[0]) & (points["z"] < SOLE_MM[1])
    for camera in np.unique(points["camera"]):
        if camera in views and views[camera].centre[2] < 0:
            own = is_sole & (points["camera"] == camera)
            seen = np.zeros(cameras.shape, np.bool_)
            seen[plane[own], strip[own]] = True
            cameras += seen
    return np.asarray((np.abs(points["z"]) <= glass_mm) & (cameras >= 2)[plane, strip])


def _planes(points: NDArray[np.void]) -> NDArray[np.int64]:
    """(N,) the number of each point's plane."""
    step = max(stripe_step(points), PLANE_MM)
    return np.asarray(np.round((points["plane"] - points["plane"].min()) / step).astype(np.int64))


def _sides(
    plane: NDArray[np.int64], y: NDArray[np.float64], is_high: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Least and greatest Y (P,) of the high points around each plane; None if too few planes have any.

    A plane without enough high points takes those of the nearest planes before and behind it. Beyond the first and the
    last plane with high points, where there is no foot, the least Y is infinite.
    """
    planes = int(plane.max()) + 1
    low, high = np.full(planes, np.inf), np.full(planes, -np.inf)
    np.minimum.at(low, plane[is_high], y[is_high])
    np.maximum.at(high, plane[is_high], y[is_high])
    measured = np.flatnonzero(np.bincount(plane[is_high], minlength=planes) >= FEWEST_HIGH)
    if len(measured) < FEWEST_PLANES:
        return None
    number = np.arange(planes)
    before = measured[np.maximum(np.searchsorted(measured, number, side="right") - 1, 0)]
    behind = measured[np.minimum(np.searchsorted(measured, number), len(measured) - 1)]
    low, high = np.minimum(low[before], low[behind]), np.maximum(high[before], high[behind])
    is_outside = (number < measured[0] - AHEAD_PLANES) | (number > measured[-1] + AHEAD_PLANES)
    low[is_outside], high[is_outside] = np.inf, -np.inf
    return low, high

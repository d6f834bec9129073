"""Stripes beyond the ends of the foot that were dropped."""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import PLANE_MM, joined, stripe_step
from footscan.rows import distinct_rows

LEG_MM = 90.0
"""Height above which a foot's length does not end. Chosen by hand."""
FEWEST_AT_END, FEWEST_IN_STRIPE = 5, 20
"""Points that make an end, and points of one frame that make a stripe. Chosen by hand."""
NOT_CONTESTED = (math.inf, -math.inf)
"""Ends beyond which no stripe was dropped."""
END_MM, MARGIN_MM = 10.0, 3.0
"""The last part of the foot that was kept, and by how much what continues it may be broader. Chosen by hand."""
MOST_MM = 10.0
"""Farthest beyond an end that a foot is thought to reach. Chosen by hand."""
GAP_STEPS = 2.5
"""Steps of the travel between two stripes up to which the second continues the first. Chosen by hand."""


def ends_of(x: NDArray[np.floating], fewest: int = FEWEST_AT_END) -> tuple[float, float]:
    """Least and greatest of N coordinates, N >= `fewest`, that fewer strays beyond do not move.

    >>> ends_of(np.arange(100.0))
    (4.0, 95.0)
    """
    ordered = np.partition(x.astype(np.float64), [fewest - 1, -fewest])
    return float(ordered[fewest - 1]), float(ordered[-fewest])


def contested_ends(
    kept: NDArray[np.void], denied: NDArray[np.void], of_any_laser: tuple[NDArray[np.void], NDArray[np.void]]
) -> tuple[float, float]:
    """Find how far stripes that were dropped continue a foot beyond its ends.

    Where the heads are not where the calibration has them, each head's stripes contradict the others', and the last
    stripes of heel and toes, which few cameras see, are dropped for it. A stripe of another laser shows the foot, too:
    it reaches at least as far as the plane that is nearest to its middle.

    Parameters
    ----------
    kept : (N,) of `POINT_DTYPE`, mm
    denied : (M,) points that were dropped because other cameras did not confirm them
    of_any_laser : (L,) points each that were dropped because another head's laser made them, in the plane of greatest
        X, and in that of least X

    Returns
    -------
    Least and greatest X of the foot with these stripes, mm; `NOT_CONTESTED` without kept points.

    Examples
    --------
    >>> from footscan.cloud.points import make_points
    >>> y = np.tile(np.linspace(-20.0, 20.0, 40), 6)
    >>> x = np.repeat(np.arange(0.0, 12.0, 2.0), 40)
    >>> seen = make_points(np.column_stack([x, y, np.full(240, 30.0)]), camera=3, frame=(x / 2).astype(int))
    >>> print(contested_ends(seen[x > 5.0], seen[x < 5.0], (seen[:0], seen[:0])))
    (0.0, 10.0)
    """
    low = kept.compress(kept["z"] < LEG_MM)
    if len(low) < FEWEST_AT_END:
        return NOT_CONTESTED
    first, last = ends_of(low["x"])
    gap_mm = GAP_STEPS * max(stripe_step(kept), PLANE_MM)
    farthest, nearest = (joined([denied, one]) for one in of_any_laser)
    return 0.0 - _reach(low, -first, farthest, -1.0, gap_mm), _reach(low, last, nearest, 1.0, gap_mm)


def _reach(kept: NDArray[np.void], kept_end: float, denied: NDArray[np.void], way: float, gap_mm: float) -> float:
    """How far stripes reach beyond the end of what was kept, along X times `way`."""
    end = kept_end
    last = kept[way * kept["x"] > end - END_MM]
    beyond = way * denied["x"] > end
    for axis in "yz":
        beyond &= np.abs(denied[axis] - (last[axis].min() + last[axis].max()) / 2) < np.ptp(last[axis]) / 2 + MARGIN_MM
    further = denied.compress(beyond)
    frames = distinct_rows(np.column_stack([further["camera"], further["frame"]]).astype(np.int64))
    stripes = np.bincount(frames.number, way * further["x"]) / frames.counts
    for stripe in np.sort(stripes[frames.counts >= FEWEST_IN_STRIPE]):
        if stripe > min(end + gap_mm, kept_end + MOST_MM):
            break
        end = max(end, float(stripe))
    return end

"""Stripes beyond the ends of the foot that one head's cameras saw, and the others' denied."""

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import PLANE_MM, stripe_step
from footscan.rows import distinct_rows

LEG_MM = 90.0
"""Height above which a foot does not end."""
FEWEST_AT_END, FEWEST_IN_STRIPE = 5, 20
"""Points that make an end, and points of one frame that make a stripe. Chosen by hand."""
END_MM, MARGIN_MM = 10.0, 3.0
"""The last part of the foot that was kept, and by how much what continues it may be broader. Chosen by hand."""
MOST_MM = 10.0
"""Farthest beyond an end that a foot is thought to reach. Chosen by hand."""
GAP_STEPS = 2.5
"""Steps of the travel between two stripes up to which the second continues the first. Chosen by hand."""


def contested_ends(kept: NDArray[np.void], denied: NDArray[np.void]) -> tuple[float, float]:
    """Find how far stripes that were dropped continue a foot beyond its ends.

    Where the heads are not where the calibration has them, each head's stripes contradict the others', and the last
    stripes of heel and toes, which few cameras see, are dropped for it.

    Parameters
    ----------
    kept : (N,) of `POINT_DTYPE`, mm
    denied : (M,) points that were dropped because other cameras did not confirm them

    Returns
    -------
    Least and greatest X of the foot with these stripes, mm; without kept points (0, 0).

    Examples
    --------
    >>> from footscan.cloud.points import make_points
    >>> y = np.tile(np.linspace(-20.0, 20.0, 40), 6)
    >>> x = np.repeat(np.arange(0.0, 12.0, 2.0), 40)
    >>> seen = make_points(np.column_stack([x, y, np.full(240, 30.0)]), camera=3, frame=(x / 2).astype(int))
    >>> print(contested_ends(seen[x > 5.0], seen[x < 5.0]))
    (0.0, 10.0)
    """
    low = kept[kept["z"] < LEG_MM]
    if len(low) < FEWEST_AT_END:
        return 0.0, 0.0
    gap_mm = GAP_STEPS * max(stripe_step(kept), PLANE_MM)
    return 0.0 - _reach(low, denied, -1.0, gap_mm), _reach(low, denied, 1.0, gap_mm)


def _reach(kept: NDArray[np.void], denied: NDArray[np.void], way: float, gap_mm: float) -> float:
    """How far stripes reach, along X times `way`."""
    along = way * kept["x"].astype(np.float64)
    end = kept_end = float(np.partition(along, -FEWEST_AT_END)[-FEWEST_AT_END])
    last = kept[along > end - END_MM]
    beyond = way * denied["x"] > end
    for axis in "yz":
        beyond &= np.abs(denied[axis] - (last[axis].min() + last[axis].max()) / 2) < np.ptp(last[axis]) / 2 + MARGIN_MM
    further = denied[beyond]
    frames = distinct_rows(np.column_stack([further["camera"], further["frame"]]).astype(np.int64))
    stripes = np.bincount(frames.number, way * further["x"]) / frames.counts
    for stripe in np.sort(stripes[frames.counts >= FEWEST_IN_STRIPE]):
        if stripe > min(end + gap_mm, kept_end + MOST_MM):
            break
        end = max(end, float(stripe))
    return end

"""What a scan shows of its own errors."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.lasers.apart import UNKNOWN
from footscan.cloud.outliers.contested import NOT_CONTESTED
from footscan.cloud.points import POINT_DTYPE
from schemas.fusion import FusionReport
from schemas.movement import MovementReport

Floats = NDArray[np.float64]


class Evidence(NamedTuple):
    """What a scan shows of its own errors."""

    cloud: NDArray[np.void] | None = None
    """(N,) of `POINT_DTYPE`, fused: how sure each place is, and where one camera alone saw the ends"""
    agreement: FusionReport | None = None
    """Of the cameras; None: exact"""
    movement: MovementReport | None = None
    """Of the foot; None: it stood still"""
    lasers: Floats = UNKNOWN
    """(L, 6) as of `lasers_of`: one camera alone may see an end too far out by the largest distance of two, and cameras
    see the stripes of two close ones as one, unless they are parted"""
    seen: NDArray[np.void] = np.empty(0, POINT_DTYPE)
    """(P,) of `POINT_DTYPE`, the points of all cameras before they were fused"""
    parted_mm: NDArray[np.float32] = np.empty(0, np.float32)
    """(P,) how far from each of them its camera sees the stripe of another laser, as of `parted_mm`"""
    contested_mm: tuple[float, float] = NOT_CONTESTED
    """Least and greatest X of the foot with stripes that were dropped for contradicting other cameras"""
    tip_doubts_mm: tuple[float, float] = (0.0, 0.0)
    """Standard deviation of the X of heel and toes, where they lie beyond the stripes"""


NO_EVIDENCE = Evidence()
"""That of a scan of which the surface alone is known."""

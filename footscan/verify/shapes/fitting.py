"""Helpers of the fits of reference bodies to points."""

import numpy as np
from numpy.typing import NDArray

from footscan.robust import MAD_TO_SD
from footscan.rows import distinct_rows
from schemas.base.errors import Finding
from schemas.fits import Vector

Floats = NDArray[np.float64]


def distinct_points(points: Floats) -> Floats:
    """Returns (M, 3) the distinct points, mm, in an order that does not depend on that of the input.

    Raises
    ------
    Finding
        Some coordinates are no numbers.
    """
    points = np.asarray(points, np.float64).reshape(-1, 3)
    if not np.isfinite(points).all():
        raise Finding("some coordinates are no numbers, expected mm")
    return distinct_rows(points).rows


def robust_deviation(values: Floats) -> float:
    """Standard deviation of the normal distribution that has the median absolute deviation of `values`; 0 without any.

    Examples
    --------
    >>> round(robust_deviation(np.array([1.0, 2.0, 3.0, 4.0, 100.0])), 4)
    1.4826
    """
    return MAD_TO_SD * float(np.median(np.abs(values - np.median(values)))) if len(values) else 0.0


def as_vector(values: Floats) -> Vector:
    """(3,) `values` as a tuple."""
    x, y, z = values.tolist()
    return x, y, z

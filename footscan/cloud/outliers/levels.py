"""The thesis's levels of outliers, for comparison: nearest distance, and the median along a stripe.

They ask nothing of other cameras: what stands alone is dropped, and what lies beside its neighbours.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.spatial import KDTree

from footscan.cloud.points import coordinates

MEDIAN_POINTS = 11
"""Points of a stripe of which the median is taken: about 4 mm of it. Chosen by hand; the thesis gives no number."""


def is_far(points: NDArray[np.void], nearest_mm: float) -> NDArray[np.bool_]:
    """Select the points (N,) without another one within `nearest_mm`.

    >>> from footscan.cloud.points import make_points
    >>> places = np.array([[0.0, 0.0, 0.0], [0.0, 0.4, 0.0], [0.0, 9.0, 0.0]])
    >>> print(is_far(make_points(places, camera=1), 2.0))
    [False False  True]
    """
    places = coordinates(points)
    if len(places) < 2:
        return np.ones(len(places), np.bool_)
    distances = np.asarray(KDTree(places).query(places, k=2)[0])
    return np.asarray(distances[:, 1] > nearest_mm)


def is_off_median(points: NDArray[np.void], median_mm: float) -> NDArray[np.bool_]:
    """Select the points (N,) that lie farther than `median_mm` from the median of their neighbours along the stripe.

    >>> from footscan.cloud.points import make_points
    >>> places = np.column_stack([np.zeros(21), 0.2 * np.arange(21), np.zeros(21)])
    >>> places[10, 2] = 5.0
    >>> points = make_points(places, camera=1, frame=np.zeros(21, int), source=np.arange(21))
    >>> print(np.flatnonzero(is_off_median(points, 2.0)))
    [10]
    """
    order = np.lexsort([points["source"], points["frame"], points["camera"]])
    ordered = points.take(order)
    new = np.flatnonzero((np.diff(ordered["frame"]) != 0) | (np.diff(ordered["camera"]) != 0)) + 1
    off = np.zeros(len(points), np.bool_)
    for stripe in np.split(order, new):
        across = np.column_stack([points["y"][stripe], points["z"][stripe]]).astype(np.float64)
        middle = median_filter(across, size=(MEDIAN_POINTS, 1), mode="nearest")
        off[stripe] = np.hypot(*(across - middle).T) > median_mm
    return off

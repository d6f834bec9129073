"""Stripes of two lasers that a camera sees apart: each of them is found where it is."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

FARTHEST_MM = 12.0
"""Distance beyond which a stripe does not lie beside another: four times that of two lasers whose stripes may be one,
as on skin that faces the travel. Chosen by hand."""
FRAMES_APART_MM = 1e3
"""Distance by which stripes of two frames, or of two views, are kept from lying beside each other."""


def parted_mm(points: NDArray[np.void], others: NDArray[np.void]) -> NDArray[np.float32]:
    """Compute how far from each point the same view sees the stripe of another laser in the same frame.

    Parameters
    ----------
    points, others : (N,) and (M,) of `POINT_DTYPE`, of their own laser and of another one, all mapped as if they lay in
        the plane of their own

    Returns
    -------
    (N,) mm, infinite beyond `FARTHEST_MM`.

    Examples
    --------
    >>> from footscan.cloud.points import make_points
    >>> own = make_points(np.array([[5.0, 0, 40], [7.0, 0, 41]]), camera=3, frame=np.array([7, 8]))
    >>> parted_mm(own, make_points(np.array([[5.0, 1.5, 40]]), camera=3, frame=7)).tolist()
    [1.5, inf]
    """
    if not len(others):
        return np.full(len(points), np.inf, np.float32)
    distance, _ = KDTree(_of_frames(others)).query(_of_frames(points), distance_upper_bound=FARTHEST_MM)
    return np.asarray(distance, np.float32)


def _of_frames(points: NDArray[np.void]) -> NDArray[np.float64]:
    """(N, 4) Y and Z, mm, and frame and view as if they were places `FRAMES_APART_MM` apart."""
    apart = [FRAMES_APART_MM * points[name] for name in ("frame", "camera")]
    return np.column_stack([points["y"], points["z"], *apart])

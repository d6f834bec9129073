"""Histograms of distances."""

import numpy as np
from numpy.typing import NDArray

from schemas.quality import Histogram

NARROWEST_MM = 1e-4
"""Least width of a class, the resolution of distances (`ON_MM` in `distances`)."""


def histogram(distances: NDArray[np.floating], classes: int, *, signed: bool) -> Histogram:
    """Count (N,) `distances` in mm, N > 0, in `classes` (> 0) equal classes from the least to the greatest.

    A class includes its lower edge; the last one also its upper edge.

    Examples
    --------
    >>> histogram(np.array([0.0, 1.0, 1.5, 4.0]), 4, signed=False).counts
    [1, 2, 0, 1]
    """
    low, high = np.float64(distances.min()), np.float64(distances.max())  # single precision would merge edges
    high = max(high, low + classes * NARROWEST_MM)
    edges = np.linspace(low, high, classes + 1)
    # By range, not by edges: numpy then works in blocks, without a search.
    counts, _ = np.histogram(distances, classes, (low, high))
    return Histogram(
        signed=signed,
        edges_mm=edges.tolist(),
        counts=counts.tolist(),
        shares=(counts / len(distances)).tolist(),
    )

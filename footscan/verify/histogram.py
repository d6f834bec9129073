"""Classes of distances."""

import numpy as np
from numpy.typing import NDArray

from schemas.quality import Histogram

NARROWEST_MM = 1e-4
"""No class is narrower: distances are not known more finely."""


def histogram(distances: NDArray[np.floating], classes: int, *, signed: bool) -> Histogram:
    """How many of (N,) `distances` in mm, N > 0, lie in each of `classes` (> 0) equal classes from the least to the
    greatest.

    A class holds its lower edge, the last one its upper edge, too.
    """
    low, high = np.float64(distances.min()), np.float64(distances.max())  # double: single tells too few edges apart
    high = max(high, low + classes * NARROWEST_MM)
    edges = np.linspace(low, high, classes + 1)
    # By range, not by edges: numpy then goes through the distances in blocks, without a search.
    counts, _ = np.histogram(distances, classes, (low, high))
    return Histogram(
        signed=signed,
        edges_mm=edges.tolist(),
        counts=counts.tolist(),
        shares=(counts / len(distances)).tolist(),
    )

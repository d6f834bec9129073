"""What a frame and a film yield: stripe points."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

STRIPE_DTYPE = np.dtype(
    [("frame", "<i4"), ("i", "<f8"), ("j", "<f8"), ("width", "<f4"), ("peak", "<f4"), ("score", "<f4")]
)
"""One point of the stripe.

frame : number of the frame in its film, from 0
i, j : centre of the stripe, px, image frame: column and row, the centre of the top-left pixel at (0, 0)
width : full width at half height across the stripe, px
peak : red at the centre, grey levels 0 to 255
score : 0 to 1, how far the stripe stands out times how symmetric it is across
"""

StripePoints = NDArray[np.void]
"""(N,) of `STRIPE_DTYPE`."""


def film_points(frames: Iterable[tuple[int, StripePoints]]) -> StripePoints:
    """The points of all frames of a film in one array, from pairs of frame number and points."""
    parts = [np.empty(0, STRIPE_DTYPE)]
    for number, points in frames:
        part = points.copy()
        part["frame"] = number
        parts.append(part)
    return np.concatenate(parts)

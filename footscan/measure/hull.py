"""The convex hull of points in a plane; compiled, since a tape is laid around many sections."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]

STRAIGHT = 1e-12
"""Sine of the turn at a corner that is none."""


def hull_corners(points: Floats) -> NDArray[np.int64]:
    """(K,) which of (N, 2) points are the corners of their convex hull, counter-clockwise; less than three where they
    lie on a line.

    Andrew, "Another efficient algorithm for convex hulls in two dimensions", Inf. Process. Lett. 9(5), 1979,
    doi:10.1016/0020-0190(79)90072-3.
    """
    order = np.lexsort((points[:, 1], points[:, 0]))
    return _chains(points, np.stack([order, order[::-1]]))


@compiled
def _chains(points: Floats, ways: NDArray[np.int64]) -> NDArray[np.int64]:
    """The lower chain of corners and the upper one, along (2, N) the points in their order forth and back."""
    corners = np.empty(ways.size + 1, np.int64)
    count = 0
    for way in ways:
        start = count
        for point in way:
            while count > start + 1 and not _turns_left(points, corners[count - 2], corners[count - 1], point):
                count -= 1
            corners[count] = point
            count += 1
        count -= 1  # where the other chain begins
    return corners[:count]


@compiled
def _turns_left(points: Floats, a: int, b: int, c: int) -> bool:
    x, y = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    next_x, next_y = points[c, 0] - points[b, 0], points[c, 1] - points[b, 1]
    turned: bool = x * next_y - y * next_x > STRAIGHT * np.hypot(x, y) * np.hypot(next_x, next_y)
    return turned

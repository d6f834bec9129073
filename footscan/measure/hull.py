"""Convex hull of points in a plane; compiled, since a tape is laid around many sections."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]

STRAIGHT = 1e-12
"""Sine of the largest turn that rounding gives a straight line; such a corner is left out."""


def hull_corners(points: Floats) -> NDArray[np.int64]:
    """Returns (K,) the numbers of the corners of the convex hull of (N, 2) `points`, counter-clockwise.

    There are fewer than three if the points lie on a line.

    A. Andrew, "Another efficient algorithm for convex hulls in two dimensions", Inf. Process. Lett. 9(5), 1979,
    doi:10.1016/0020-0190(79)90072-3.

    Examples
    --------
    >>> hull_corners(np.array([[0.0, 0], [2, 0], [1, 1], [2, 2], [0, 2]])).tolist()
    [0, 1, 3, 4]
    """
    order = np.lexsort((points[:, 1], points[:, 0]))
    return _chains(points, np.stack([order, order[::-1]]))


@compiled
def _chains(points: Floats, ways: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the lower chain of corners, then the upper one; `ways` are (2, N) the points sorted forth and back."""
    corners = np.empty(ways.size + 1, np.int64)
    count = 0
    for way in ways:
        start = count
        for point in way:
            while count > start + 1 and not _turns_left(points, corners[count - 2], corners[count - 1], point):
                count -= 1
            corners[count] = point
            count += 1
        count -= 1  # the other chain begins at this corner
    return corners[:count]


@compiled
def _turns_left(points: Floats, a: int, b: int, c: int) -> bool:
    x, y = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    next_x, next_y = points[c, 0] - points[b, 0], points[c, 1] - points[b, 1]
    turned: bool = x * next_y - y * next_x > STRAIGHT * np.hypot(x, y) * np.hypot(next_x, next_y)
    return turned

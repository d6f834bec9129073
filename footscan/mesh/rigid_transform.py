"""Rigid transforms of points, points within a box, and the height of a foot below its leg."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]
Bounds = tuple[float, float]
"""Lower and upper bound, mm."""

FREE = (-np.inf, np.inf)
"""No bounds"""

LOW_MM, LOW_SHARE = 60.0, 0.24
"""Below this height and this share of the length there is foot and no leg. The pternion is at a height of 0.06 to 0.13
of the length. Chosen by hand."""


def apply(transform: NDArray[np.floating], points: NDArray[np.floating]) -> Floats:
    """Returns (N, 3) `points` moved by a (4, 4) `transform`.

    Examples
    --------
    >>> apply(turn_about_z(np.pi / 2), np.array([[1.0, 0, 5]])).round(6).tolist()
    [[0.0, 1.0, 5.0]]
    """
    return _moved(np.ascontiguousarray(transform, np.float64), np.ascontiguousarray(points, np.float64))


def turn_about_z(angle: float) -> Floats:
    """Returns the (4, 4) rotation about Z by `angle` in radians, from X towards Y."""
    transform = np.eye(4)
    transform[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return transform


def low_height(length: float) -> float:
    """Height in mm below which a foot of this length in mm is foot and no leg."""
    return min(LOW_MM, LOW_SHARE * length)


@compiled
def _moved(transform: Floats, points: Floats) -> Floats:
    """Move the points in a loop, which is faster than a product of such thin matrices."""
    moved = np.empty((len(points), 3))
    for axis in range(3):
        x, y, z, shift = transform[axis, 0], transform[axis, 1], transform[axis, 2], transform[axis, 3]
        for k in range(len(points)):
            moved[k, axis] = x * points[k, 0] + y * points[k, 1] + z * points[k, 2] + shift
    return moved


def points_within(points: Floats, x: Bounds = FREE, y: Bounds = FREE, z: Bounds = FREE) -> Floats:
    """Returns those of (N, 3) `points` that lie within a box, bounds included; mm."""
    low, high = np.array([x, y, z], np.float64).T.copy()
    return _within(points, low, high)


@compiled
def _within(points: Floats, low: Floats, high: Floats) -> Floats:
    kept, count = np.empty(points.shape), 0
    for k in range(len(points)):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        if low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]:
            kept[count, 0], kept[count, 1], kept[count, 2] = x, y, z
            count += 1
    return kept[:count].copy()

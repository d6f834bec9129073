"""Moving of points, and how high a foot reaches below its leg."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LOW_MM, LOW_SHARE = 60.0, 0.24
"""Below this height, and this part of the length, there is foot and no leg; the pternion is at 0.06 to 0.13 of it."""


def apply(transform: NDArray[np.floating], points: NDArray[np.floating]) -> Floats:
    """(N, 3) `points` moved by a (4, 4) `transform`."""
    moved = np.empty((len(points), 3))
    for axis in range(3):  # faster than a product of matrices so thin
        x, y, z, shift = transform[axis]
        moved[:, axis] = x * points[:, 0] + y * points[:, 1] + z * points[:, 2] + shift
    return moved


def turn_about_z(angle: float) -> Floats:
    """(4, 4) rotation by `angle` in radians."""
    transform = np.eye(4)
    transform[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return transform


def low_height(length: float) -> float:
    """Height in mm below which there is foot and no leg."""
    return min(LOW_MM, LOW_SHARE * length)

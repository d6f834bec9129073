"""Moving of points, and how high a foot reaches below its leg."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]

LOW_MM, LOW_SHARE = 60.0, 0.24
"""Below this height, and this part of the length, there is foot and no leg; the pternion is at 0.06 to 0.13 of it."""


def apply(transform: NDArray[np.floating], points: NDArray[np.floating]) -> Floats:
    """(N, 3) `points` moved by a (4, 4) `transform`."""
    return _moved(np.ascontiguousarray(transform, np.float64), np.ascontiguousarray(points, np.float64))


def turn_about_z(angle: float) -> Floats:
    """(4, 4) rotation by `angle` in radians."""
    transform = np.eye(4)
    transform[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return transform


def low_height(length: float) -> float:
    """Height in mm below which there is foot and no leg."""
    return min(LOW_MM, LOW_SHARE * length)


@compiled
def _moved(transform: Floats, points: Floats) -> Floats:
    """Faster than a product of matrices so thin."""
    moved = np.empty((len(points), 3))
    for k in range(len(points)):
        x, y, z = points[k]
        for axis in range(3):
            along = transform[axis]
            moved[k, axis] = along[0] * x + along[1] * y + along[2] * z + along[3]
    return moved

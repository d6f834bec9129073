"""Faces as files tell them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def fan(polygon: Sequence[int]) -> list[list[int]]:
    """A polygon cut into triangles that meet at its first corner."""
    return [[polygon[0], polygon[k], polygon[k + 1]] for k in range(1, len(polygon) - 1)]


def vertex_numbers(triangles: "Sequence[Sequence[int]] | NDArray[np.generic]") -> NDArray[np.int32]:
    """(F, 3) triangles; a number that no vertex can have raises a ValueError."""
    limits = np.iinfo(np.int32)
    try:
        numbers = np.asarray(triangles, np.int64).reshape(-1, 3)
    except OverflowError:
        numbers = np.full((1, 3), np.iinfo(np.int64).max)
    if numbers.size and not limits.min <= int(numbers.min()) <= int(numbers.max()) <= limits.max:
        raise ValueError("a face with a number too large for a vertex")
    return numbers.astype(np.int32)

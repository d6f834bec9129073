"""Points sorted into cubes, so that compiled loops find the points around a place."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.rows import limits

Ints = NDArray[np.int64]
MAX_CUBES = 20_000_000
"""Bound of memory: cubes are made larger where there would be more."""


class Buckets(NamedTuple):
    """The points in cube (a, b, c) are `order[start[k] : start[k + 1]]` with k = (a * dims[1] + b) * dims[2] + c."""

    edge: float
    """Edge of a cube, mm"""
    low: NDArray[np.float64]
    """(3,) corner of cube (0, 0, 0), mm"""
    dims: NDArray[np.int64]
    """(3,) number of cubes along each axis"""
    start: NDArray[np.int64]
    """(K + 1,) place in `order` where the points of each cube begin"""
    order: NDArray[np.int64]
    """(N,) numbers of the points, rising within a cube"""


def sort_into_cubes(points: NDArray[np.float64], edge: float) -> Buckets:
    """Sort (N, 3) `points` into cubes with an `edge` in mm; the edge grows if there would be too many cubes.

    Examples
    --------
    >>> buckets = sort_into_cubes(np.array([[0.0, 0, 0], [0, 0, 5], [0, 0, 1]]), edge=2.0)
    >>> buckets.dims.tolist(), buckets.start.tolist(), buckets.order.tolist()
    ([1, 1, 3], [0, 2, 2, 3], [0, 2, 1])
    """
    low, high = limits(points)
    extent = high - low
    while np.prod(np.floor(extent / edge) + 1) > MAX_CUBES:
        edge *= 1.5
    dims = np.floor(extent / edge).astype(np.int64) + 1
    cube = np.floor((points - low) / edge).astype(np.int64) @ np.array([dims[1] * dims[2], dims[2], 1])
    return Buckets(edge, low, dims, *grouped(cube, int(dims.prod())))


@compiled
def grouped(numbers: Ints, groups: int) -> tuple[Ints, Ints]:
    """Sort items by their group, a number from 0, by counting: it does not take the N log N of a sort.

    Returns (G + 1,) where the items of each group begin, and (N,) the items, rising within a group.

    >>> start, order = grouped(np.array([2, 0, 2]), groups=3)
    >>> start.tolist(), order.tolist()
    ([0, 1, 1, 3], [1, 0, 2])
    """
    start = np.zeros(groups + 1, np.int64)
    for number in numbers:
        start[number + 1] += 1
    start = np.cumsum(start)
    order, free = np.empty(len(numbers), np.int64), start.copy()
    for item in range(len(numbers)):
        order[free[numbers[item]]] = item
        free[numbers[item]] += 1
    return start, order

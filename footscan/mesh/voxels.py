"""Points grouped by the cells of a grid."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.rows import limits

Floats = NDArray[np.float64]

EMPTY = -1
"""Number of a cell without points."""
BORDER = 4
"""Width of the border of the grid in cells. At least this number less one are empty, so that neighbours within that
distance need no test against the bounds."""
MOST_CELLS = 20_000_000
"""Bound of memory: cells are made larger where there would be more."""


class Voxels(NamedTuple):
    """The cells of a grid that hold points."""

    origin: Floats
    """(3,) mm, the lower corner of the first cell. The lowest points lie in the middle of their cells, so that rounding
    does not move points in planes one cell apart into the same cell."""
    size: Floats
    """(3,) mm, the edges of a cell"""
    number: NDArray[np.int32]
    """(A, B, C) the number of the cell among those that hold points, or `EMPTY`"""
    voxel: NDArray[np.int32]
    """(N,) the number of the cell that holds each point"""
    place: NDArray[np.int32]
    """(V, 3) the place of each numbered cell in the grid"""


def voxelise(xyz: Floats, size: tuple[float, float, float]) -> Voxels:
    """Group points by cells, which are numbered by X, then Y, then Z of their places.

    Parameters
    ----------
    xyz : (N, 3) float64, mm, finite, N >= 1
    size : edges of a cell, mm; they grow if there would be too many cells

    Examples
    --------
    >>> voxels = voxelise(np.array([[0.0, 0, 0], [0, 0, 9], [0.1, 0, 0]]), (1.0, 1.0, 1.0))
    >>> voxels.voxel.tolist(), len(voxels.place)
    ([0, 1, 0], 2)
    """
    edges = np.array(size)
    low, high = limits(xyz)
    extent = high - low
    while np.prod(np.floor(extent / edges + 0.5) + 1 + 2 * BORDER) > MOST_CELLS:
        edges = edges * 1.5
    origin = low - (BORDER + 0.5) * edges
    shape = tuple((np.floor(extent / edges + 0.5) + 1 + 2 * BORDER).astype(np.int64).tolist())
    number = np.full(shape, EMPTY, np.int32)
    cells = _mark(xyz, origin, edges, number)
    places = _count_off(number)
    return Voxels(origin, edges, number, number.ravel()[cells], places)


@compiled
def _mark(xyz: Floats, origin: Floats, edges: Floats, number: NDArray[np.int32]) -> NDArray[np.int64]:
    """Returns (N,) the flat index of each point's cell; sets cells with points to 0 in `number`."""
    cells = np.empty(len(xyz), np.int64)
    flat = number.reshape(-1)
    _, columns, rows = number.shape
    for n in range(len(xyz)):
        a = int((xyz[n, 0] - origin[0]) / edges[0])
        b = int((xyz[n, 1] - origin[1]) / edges[1])
        c = int((xyz[n, 2] - origin[2]) / edges[2])
        cells[n] = (a * columns + b) * rows + c
        flat[cells[n]] = 0
    return cells


@compiled
def _count_off(number: NDArray[np.int32]) -> NDArray[np.int32]:
    """Number the cells that are not empty in place; returns (V, 3) their places."""
    count = 0
    for cell in number.reshape(-1):
        if cell != EMPTY:
            count += 1
    places = np.empty((count, 3), np.int32)
    count = 0
    for a in range(number.shape[0]):
        for b in range(number.shape[1]):
            for c in range(number.shape[2]):
                if number[a, b, c] != EMPTY:
                    number[a, b, c] = count
                    places[count, 0], places[count, 1], places[count, 2] = a, b, c
                    count += 1
    return places

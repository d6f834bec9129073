"""Errors of the vertices of a surface that have one cause, and what nearby vertices share of them."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from footscan.compiled import compiled
from footscan.rows import limits
from schemas.measures import ErrorCause

Floats = NDArray[np.float64]

REACH_MM = 10.0
"""Distance over which vertices share their error. Tuned on feet of the virtual scanner."""
NARROW_MM = 3.0
"""The smaller distance over which vertices share noise, and what is filled at the ends: the tip of a toe moves to its
side if one half of its cap errs. Chosen by hand, after scanners (`draw_assembled`, seeds 805 and 806) whose axes
through the second toe were off by 0.4 degrees."""
WIDE_MM = 60.0
"""Distance over which errors of whole cameras and heads vary on the foot. Chosen by hand."""


class ErrorField(NamedTuple):
    """Errors of the vertices that have one cause."""

    cause: ErrorCause
    deviations: Floats
    """(V,) standard deviations of the displacement along the normal, mm; of vertices that share an error, with the sign
    in which it displaces each"""
    reach_mm: float = 0.0
    """Distance over which vertices share their error; 0: each has its own."""
    along_mm: Floats | None = None
    """(V,) mm: all vertices at about the same one share their error, as where the whole foot moved while it was
    scanned; None: those at about the same place"""

    def shares(self, vertices: Floats) -> csr_array | None:
        """(V, N) shares of N independent standard normal errors in that of each vertex, in its standard deviations;
        None where each vertex has its own.

        `vertices` : (V, 3) mm
        """
        if not self.reach_mm:
            return None
        return _shares(vertices if self.along_mm is None else self.along_mm[:, None], self.reach_mm)

    def of(self, source: NDArray[np.intp]) -> "ErrorField":
        """The errors of W other vertices; source : (W,) index of the vertex that each of them was."""
        along_mm = None if self.along_mm is None else self.along_mm[source]
        return self._replace(deviations=self.deviations[source], along_mm=along_mm)


def _shares(places: Floats, reach_mm: float) -> csr_array:
    """(V, N) linear interpolation at `places` (V, D) between errors at the N nodes of a grid, of unit variance."""
    cells = places / reach_mm
    cells -= np.floor(limits(cells)[0])
    size = limits(cells)[1].astype(np.int64) + 2
    columns, weights, count = _corners_of_cells(cells, size)
    starts = np.arange(len(places) + 1) * columns.shape[1]
    return csr_array((weights.ravel(), columns.ravel(), starts), shape=(len(places), count))


@compiled
def _corners_of_cells(cells: Floats, size: NDArray[np.int64]) -> tuple[NDArray[np.int64], Floats, int]:
    """Returns (V, 2^D) the corners of each place's cell, numbered without gaps in the order of the grid, (V, 2^D) their
    weights and the number of all corners.

    cells : (V, D) places in a grid of `size` (D,) nodes
    """
    dimensions = len(size)
    corners = 2**dimensions
    node, weight = np.empty((len(cells), corners), np.int64), np.empty((len(cells), corners))
    number = np.zeros(np.prod(size), np.int64)
    for k in range(len(cells)):
        squares = 0.0
        for corner in range(corners):
            place, share = 0, 1.0
            for axis in range(dimensions):
                low = int(cells[k, axis])
                part, ahead = cells[k, axis] - low, (corner >> (dimensions - 1 - axis)) & 1
                place = place * size[axis] + low + ahead
                share *= part if ahead else 1.0 - part
            node[k, corner], weight[k, corner] = place, share
            number[place] = 1
            squares += share * share
        weight[k] /= np.sqrt(squares)
    number = np.cumsum(number) - 1
    for k in range(len(cells)):
        for corner in range(corners):
            node[k, corner] = number[node[k, corner]]
    return node, weight, number[-1] + 1


def broad_and_narrow(cause: ErrorCause, deviations: Floats) -> list[ErrorField]:
    """Errors (V,) of which half the variance is shared by vertices far from each other, and half by near ones only."""
    return [ErrorField(cause, math.sqrt(0.5) * deviations, reach_mm) for reach_mm in (REACH_MM, NARROW_MM)]

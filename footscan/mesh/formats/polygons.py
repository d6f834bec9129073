"""Faces of files as polygons, and their triangles."""

from array import array
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from schemas.base.limits import limit, refuse_beyond


class Polygons(NamedTuple):
    """Polygons in two arrays; a list for each of millions of faces would take ten times the memory."""

    lengths: NDArray[np.int64]
    """(P,) number of vertices of each polygon; fewer than three make no triangle"""
    vertices: NDArray[np.int64]
    """The vertices of the first polygon, then of the second, and so on"""


class PolygonList:
    """Polygons that are read one by one; raises BeyondLimitError if there are too many."""

    def __init__(self) -> None:
        self._lengths, self._vertices = array("q"), array("q")
        self._most, self._most_corners = limit("mesh_rows"), limit("polygon_corners")

    def add(self, vertices: Iterable[int]) -> None:
        """Add a polygon; raises ValueError for a number that no vertex can have."""
        before = len(self._vertices)
        try:
            self._vertices.extend(vertices)
        except OverflowError:
            raise ValueError("a face with a number too large for a vertex") from None
        corners = len(self._vertices) - before
        self._lengths.append(corners)
        if corners > self._most_corners:
            refuse_beyond("polygon_corners", corners, "mesh")
        if len(self._vertices) > self._most:
            refuse_beyond("mesh_rows", len(self._vertices), "mesh")

    def polygons(self) -> Polygons:
        """The polygons that were added."""
        return Polygons(np.array(self._lengths, np.int64), np.array(self._vertices, np.int64))


def fans(polygons: Polygons) -> NDArray[np.int32]:
    """Returns (F, 3) the triangles of the polygons; those of one polygon meet at its first corner.

    Examples
    --------
    >>> fans(Polygons(np.array([4, 2, 3]), np.array([5, 6, 7, 8, 0, 1, 2, 3, 4]))).tolist()
    [[5, 6, 7], [5, 7, 8], [2, 3, 4]]
    """
    triangles = np.maximum(polygons.lengths - 2, 0)
    first = np.repeat(np.cumsum(polygons.lengths) - polygons.lengths, triangles)
    number = np.arange(len(first)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return vertex_numbers(polygons.vertices[np.column_stack([first, first + number + 1, first + number + 2])])


def vertex_numbers(triangles: "NDArray[np.generic]") -> NDArray[np.int32]:
    """Returns (F, 3) int32 triangles; raises ValueError for a number that no vertex can have."""
    limits = np.iinfo(np.int32)
    numbers = triangles.reshape(-1, 3)
    if numbers.size and not limits.min <= numbers.min() <= numbers.max() <= limits.max:  # NaN is not between them
        raise ValueError("a face with a number too large for a vertex")
    return numbers.astype(np.int32)

"""Points that represent a surface also where its triangles are large."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]

MOST = 64
"""Bound of memory: parts into which an edge is divided."""


def dense_points(vertices: Floats, faces: NDArray[np.integer], spacing: float) -> Floats:
    """Returns (N, 3) the vertices, followed by points in triangles whose longest edge exceeds `spacing` mm.

    Each such triangle holds an even lattice that does not depend on its pose, so that measures on these points move and
    are mirrored with the mesh. Points on edges that two triangles share are listed twice.

    Examples
    --------
    A triangle with edges of at most 2 mm gets a point in the middle of each edge:

    >>> corners = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0]])
    >>> dense_points(corners, np.array([[0, 1, 2]]), spacing=1.5)[3:].tolist()
    [[0.0, 0.5, 0.0], [1.0, 0.5, 0.0], [1.0, 0.0, 0.0]]
    """
    return _lattices(np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64), spacing)


@compiled
def _lattices(vertices: Floats, faces: NDArray[np.int64], spacing: float) -> Floats:
    parts = np.empty(len(faces), np.int64)
    total = len(vertices)
    for face in range(len(faces)):
        longest = 0.0
        for k in range(3):
            start, end = faces[face, k], faces[face, (k + 1) % 3]
            squared = 0.0
            for axis in range(3):
                squared += (vertices[end, axis] - vertices[start, axis]) ** 2
            longest = max(longest, squared)
        parts[face] = min(max(np.ceil(np.sqrt(longest) / spacing - 1e-6), 1), MOST)
        total += (parts[face] + 1) * (parts[face] + 2) // 2 - 3  # the corners are vertices already
    points = np.empty((total, 3))
    for vertex in range(len(vertices)):
        for axis in range(3):
            points[vertex, axis] = vertices[vertex, axis]
    place = len(vertices)
    for face in range(len(faces)):
        a, b, c = faces[face]
        count = parts[face]
        for i in range(count + 1):
            for j in range(count + 1 - i):
                if max(i, j, count - i - j) == count:
                    continue
                first, second, third = j / count, i / count, (count - i - j) / count
                for axis in range(3):
                    points[place, axis] = (
                        first * vertices[a, axis] + second * vertices[b, axis] + third * vertices[c, axis]
                    )
                place += 1
    return points

"""Points that stand for a surface wherever its triangles are large."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]

MOST = 64
"""Parts that an edge is divided into, at most."""


def dense_points(vertices: Floats, faces: NDArray[np.integer], spacing: float) -> Floats:
    """(N, 3) the vertices, followed by points on edges and in triangles whose longest edge exceeds `spacing`.

    Each such triangle holds an even lattice, the same however the mesh lies in space: what is measured on these points
    moves and is mirrored with the mesh. On edges that two triangles share they stand twice.
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
        total += (parts[face] + 1) * (parts[face] + 2) // 2 - 3  # the corners stand among the vertices
    points = np.empty((total, 3))
    points[: len(vertices)] = vertices
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

"""Points that stand for a surface wherever its triangles are large."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MOST = 64
"""Parts that an edge is divided into, at most."""


def dense_points(vertices: Floats, faces: NDArray[np.integer], spacing: float) -> Floats:
    """(N, 3) the vertices, followed by points on edges and in triangles whose longest edge exceeds `spacing`.

    Each such triangle holds an even lattice, the same however the mesh lies in space: what is measured on these points
    moves and is mirrored with the mesh. On edges that two triangles share they stand twice.
    """
    corners = vertices[faces]
    edges = corners - np.roll(corners, 1, axis=1)
    longest = np.sqrt(np.einsum("nki,nki->nk", edges, edges).max(axis=1, initial=0.0))
    parts = np.clip(np.ceil(longest / spacing - 1e-6), 1, MOST).astype(np.intp)
    points = [vertices]
    for count in np.unique(parts[parts > 1]):
        a, b = (grid.reshape(-1) for grid in np.meshgrid(np.arange(count + 1), np.arange(count + 1)))
        inside = (a + b <= count) & (np.maximum(np.maximum(a, b), count - a - b) < count)
        shares = np.column_stack([a, b, count - a - b])[inside] / count
        points.append(np.einsum("pk,nki->npi", shares, corners[parts == count]).reshape(-1, 3))
    return np.concatenate(points)

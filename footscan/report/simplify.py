"""A mesh with fewer triangles, for looking at only."""

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.cells import cell_means, group_by_cell


def simplify(
    vertices: NDArray[np.float64], faces: NDArray[np.integer], values: NDArray[np.float64], most_triangles: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """The mesh with at most `most_triangles` (> 0), its vertices averaged over the cells of a grid.

    Cells are as small as that allows. A mesh that is small enough keeps its triangles; vertices without a triangle are
    dropped. After Rossignac and Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993.

    Parameters
    ----------
    vertices : (V, 3) float64, mm
    faces : (F, 3) int
    values : (V, K) float64, averaged like the vertices

    Returns
    -------
    vertices, faces, values : of the simplified mesh
    """
    used, renumbered = np.unique(faces, return_inverse=True)
    vertices, values = vertices[used], values[used]
    triangles = renumbered.reshape(-1, 3).astype(np.int64)
    if len(triangles) <= most_triangles:
        return vertices, triangles, values
    corners = vertices[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    # A plane cut by a grid gives two triangles a cell. A curved surface meets more cells: the edge grows until it fits.
    cell = np.sqrt(2 * area / most_triangles)
    while True:
        order, starts = group_by_cell(vertices, np.full(3, cell))
        cell_of = np.empty(len(vertices), np.int64)
        cell_of[order] = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(order))))
        a, b, c = cell_of[triangles].T
        kept = cell_of[triangles][(a != b) & (b != c) & (c != a)]
        if len(kept) <= most_triangles:
            break
        cell *= 1.1
    means = cell_means(np.column_stack([vertices, values]), order, starts, np.ones(len(vertices)))
    return means[:, :3], kept, means[:, 3:]

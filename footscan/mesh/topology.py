"""Edges, components, vertices and their normals of triangle meshes."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from footscan.compiled import compiled
from footscan.rows import distinct_rows

Faces = NDArray[np.integer]


def directed_edges(faces: Faces) -> NDArray[np.int64]:
    """Returns (3F, 2) the edges of (F, 3) `faces`, each in the direction in which its face runs through it."""
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)


def edge_counts(faces: Faces) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns (E, 2) the edges of (F, 3) `faces`, smaller vertex first, and (E,) the number of faces at each.

    Examples
    --------
    >>> edges, counts = edge_counts(np.array([[0, 1, 2], [0, 2, 3]]))
    >>> dict(zip(map(tuple, edges.tolist()), counts.tolist()))
    {(0, 1): 1, (0, 2): 2, (0, 3): 1, (1, 2): 1, (2, 3): 1}
    """
    edges = distinct_rows(np.sort(directed_edges(faces), axis=1))
    return edges.rows, edges.counts.astype(np.int64)


def drop_tangles(faces: Faces) -> NDArray[np.int32]:
    """Drop the faces at edges where more than two meet, or where two run in the same direction."""
    edges = directed_edges(faces)
    _, _, undirected, meeting = distinct_rows(np.sort(edges, axis=1))
    _, _, directed, same_way = distinct_rows(edges)
    tangled = (meeting[undirected] > 2) | (same_way[directed] > 1)
    return faces[~tangled.reshape(3, -1).any(axis=0)].astype(np.int32)


def face_components(faces: Faces) -> NDArray[np.int32]:
    """Returns (F,) the number of the part, joined by vertices, to which each of (F, 3) `faces` belongs."""
    if not len(faces):
        return np.zeros(0, np.int32)
    size = int(faces.max()) + 1
    first, second = faces[:, :2].ravel(), faces[:, 1:].ravel()  # two edges join the corners of a face
    graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(size, size))
    _, label = connected_components(graph, directed=False)
    return _renumbered(label[faces[:, 0]])[1]


def largest_component(faces: Faces) -> NDArray[np.int32]:
    """Returns the faces of the part that has the most."""
    component = face_components(faces)
    largest: NDArray[np.bool_] = component == np.argmax(np.bincount(component))
    return faces[largest].astype(np.int32)


def keep_large_components(faces: Faces, share: float) -> NDArray[np.int32]:
    """Drop the parts that hold less than the `share` of all faces."""
    component = face_components(faces)
    keep = np.bincount(component)[component] >= share * len(faces) if len(faces) else np.zeros(0, np.bool_)
    return faces[keep].astype(np.int32)


def used_vertices(vertices: NDArray[np.float64], faces: Faces) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Returns the vertices that `faces` use, in their order, and the faces renumbered to them."""
    used, renumbered = _renumbered(faces)
    return vertices[used], renumbered


def _renumbered(numbers: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Returns the distinct numbers in rising order, and the place of each number among them, as `np.unique` does.

    The numbers are small and not negative, so that no sorting is needed.
    """
    is_used = np.zeros(int(numbers.max(initial=-1)) + 1, np.bool_)
    is_used[numbers] = True
    place = np.cumsum(is_used, dtype=np.int32) - np.int32(1)
    return np.flatnonzero(is_used), place[numbers]


def vertex_normals(vertices: NDArray[np.float64], faces: Faces) -> NDArray[np.float64]:
    """Returns (V, 3) unit normals: means of the faces around each vertex, weighted by area; 0 without faces."""
    return vertex_normals_and_areas(vertices, faces)[0]


def vertex_normals_and_areas(
    vertices: NDArray[np.float64], faces: Faces
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the normals of `vertex_normals`, and (V,) a third of the area of the faces around each vertex."""
    return _normals_and_areas(np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64))


@compiled
def _normals_and_areas(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    normals, areas = np.zeros((len(vertices), 3)), np.zeros(len(vertices))
    first, second, normal = np.empty(3), np.empty(3), np.empty(3)
    for face in range(len(faces)):
        for axis in range(3):
            first[axis] = vertices[faces[face, 1], axis] - vertices[faces[face, 0], axis]
            second[axis] = vertices[faces[face, 2], axis] - vertices[faces[face, 0], axis]
        normal[0] = first[1] * second[2] - first[2] * second[1]
        normal[1] = first[2] * second[0] - first[0] * second[2]
        normal[2] = first[0] * second[1] - first[1] * second[0]
        doubled = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
        for vertex in faces[face]:
            areas[vertex] += doubled / 6
            for axis in range(3):
                normals[vertex, axis] += normal[axis]
    for vertex in range(len(vertices)):
        length = np.sqrt(normals[vertex, 0] ** 2 + normals[vertex, 1] ** 2 + normals[vertex, 2] ** 2)
        if length > 0:
            normals[vertex] /= length
    return normals, areas

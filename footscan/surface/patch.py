"""A patch over a hole: triangulated, refined, and bent until it continues the surface around it.

After P. Liepa, "Filling holes in meshes", SGP 2003, doi:10.2312/SGP/SGP03/200-206, in its three steps.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.sparse.linalg import splu

Vertices = NDArray[np.float64]
Faces = NDArray[np.int32]
Edge = tuple[int, int]
Point = tuple[float, float, float]

MAX_PASSES = 20
"""Bound of time: rounds of halving and exchanging edges."""
TOO_LONG = 1.5
"""Edges longer than this multiple of the spacing are halved; chosen by hand."""
FAIRING_ROUNDS = 3
"""Each round takes the Laplacian of the shape before; the first takes that of a flat patch. Chosen by hand."""
RIDGE = 1e-9
"""Keeps the normal equations regular: a vertex that no face holds stays in its place."""
COTANGENTS = (-2.0, 5.0)
"""Bounds of a cotangent, so that slivers do not outweigh the other triangles; chosen by hand."""


def patch_over(rim: Vertices, spacing: float, taken: set[Edge]) -> tuple[Vertices, Faces]:
    """Triangulate a hole with inner edges about `spacing` long.

    Parameters
    ----------
    rim : (R, 3) float64, mm, in the direction in which the patch's triangles run
    spacing : mm
    taken : pairs of rim vertices, lower first, that an edge of the mesh already joins; the patch has no such edge

    Returns
    -------
    new : (N, 3) float64, mm, vertices within the patch
    triangles : (T, 3) int32; numbers below R are vertices of the rim, those from R on are vertices of `new`

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> new, triangles = patch_over(square, spacing=2.0, taken=set())
    >>> len(new), triangles.tolist()
    (0, [[0, 1, 3], [1, 2, 3]])
    """
    points: list[Point] = [tuple(corner) for corner in rim.tolist()]
    across: dict[Edge, int] = {}  # directed edge -> the third vertex of its triangle
    for triangle in _cut_ears(rim):
        _add(across, *triangle)
    for _ in range(MAX_PASSES):
        inner = [(a, b) for a, b in across if a < b and (b, a) in across]
        long = [edge for edge in inner if edge in taken or math.dist(*(points[n] for n in edge)) > TOO_LONG * spacing]
        if not long:
            break
        for a, b in long:
            _halve(across, points, a, b)
        for a, b in [(a, b) for a, b in across if a < b]:
            _exchange(across, points, a, b)
    triangles = sorted({min((a, b, c), (b, c, a), (c, a, b)) for (a, b), c in across.items()})
    new = np.array(points[len(rim) :], np.float64).reshape(-1, 3)
    return new, np.array(triangles, np.int32).reshape(-1, 3)


def fair(vertices: Vertices, faces: Faces, rim: NDArray[np.intp], new: NDArray[np.intp]) -> Vertices:
    """Move the `new` vertices to where the patches bend least; tangents at the rims are kept.

    This minimises the integral of the squared Laplacian of the position over the patches and those vertices of their
    rims that have faces all around, in the cotangent form of Pinkall and Polthier 1993,
    doi:10.1080/10586458.1993.10504266.

    Parameters
    ----------
    vertices : (V, 3) float64, mm
    faces : (F, 3)
    rim, new : numbers of vertices

    Returns
    -------
    (V, 3) float64, mm; all vertices but the `new` ones as they were
    """
    if not len(new):
        return vertices
    rows = np.unique(np.concatenate([new, rim]))
    near = faces[np.isin(faces, rows).any(axis=1)]
    for _ in range(FAIRING_ROUNDS):
        bend = _laplacian(vertices, near)[rows]
        moving = bend[:, new]
        normal_equations = moving.T @ moving + RIDGE * eye_array(len(new))
        vertices = vertices.copy()
        vertices[new] -= splu(normal_equations.tocsc()).solve(moving.T @ (bend @ vertices))
    return vertices


def _laplacian(vertices: Vertices, faces: Faces) -> csr_array:
    """(V, V) cotangent Laplacian, each row divided by the root of the vertex's area."""
    count = len(vertices)
    start, end, weight = [], [], []
    area = np.full(count, 1e-12)
    for a, b, c in (faces.T, faces.T[[1, 2, 0]], faces.T[[2, 0, 1]]):
        u, v = vertices[b] - vertices[a], vertices[c] - vertices[a]
        double = np.maximum(np.linalg.norm(np.cross(u, v), axis=1), 1e-6)
        np.add.at(area, a, double / 6)
        cotangent = np.clip(np.einsum("ni,ni->n", u, v) / double, *COTANGENTS) / 2
        start += [b, c]
        end += [c, b]
        weight += [cotangent, cotangent]
    row, column, value = np.concatenate(start), np.concatenate(end), np.concatenate(weight)
    value = value / np.sqrt(area[row])
    rows, columns = np.concatenate([row, row]), np.concatenate([column, row])
    return csr_array(coo_array((np.concatenate([value, -value]), (rows, columns)), (count, count)))


def _cut_ears(rim: Vertices) -> list[tuple[int, int, int]]:
    """Triangulate a rim of R corners with R - 2 triangles; each cuts the corner whose new edge is shortest."""
    rest = list(range(len(rim)))
    triangles = []
    while len(rest) > 3:
        corners = rim[rest]
        shortcut = np.linalg.norm(np.roll(corners, 1, axis=0) - np.roll(corners, -1, axis=0), axis=1)
        ear = int(np.argmin(shortcut))
        triangles.append((rest[ear - 1], rest[ear], rest[(ear + 1) % len(rest)]))
        del rest[ear]
    return [*triangles, (rest[0], rest[1], rest[2])] if len(rest) == 3 else []


def _halve(across: dict[Edge, int], points: list[Point], a: int, b: int) -> None:
    """Split edge a-b by a new vertex in its middle; its two triangles become four."""
    left, right, middle = across[a, b], across[b, a], len(points)
    (ax, ay, az), (bx, by, bz) = points[a], points[b]
    points.append(((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2))
    _remove(across, a, b, left)
    _remove(across, b, a, right)
    for start, end in ((left, a), (b, left), (right, b), (a, right)):
        _add(across, start, end, middle)


def _exchange(across: dict[Edge, int], points: list[Point], a: int, b: int) -> None:
    """Flip the edge a-b of its two triangles where the angles opposite to it exceed 180 degrees together."""
    if (a, b) not in across or (b, a) not in across:
        return
    left, right = across[a, b], across[b, a]
    if (left, right) in across or (right, left) in across or left == right:
        return
    if _angle(points, left, a, b) + _angle(points, right, a, b) <= math.pi + 1e-9:
        return
    _remove(across, a, b, left)
    _remove(across, b, a, right)
    _add(across, left, a, right)
    _add(across, right, b, left)


def _angle(points: list[Point], apex: int, a: int, b: int) -> float:
    """Angle in radians at `apex` between a and b, by the law of cosines."""
    p, q, r = math.dist(points[apex], points[a]), math.dist(points[apex], points[b]), math.dist(points[a], points[b])
    return math.acos(max(-1.0, min(1.0, (p * p + q * q - r * r) / (2 * p * q)))) if p * q else 0.0


def _add(across: dict[Edge, int], a: int, b: int, c: int) -> None:
    across[a, b], across[b, c], across[c, a] = c, a, b


def _remove(across: dict[Edge, int], a: int, b: int, c: int) -> None:
    del across[a, b], across[b, c], across[c, a]

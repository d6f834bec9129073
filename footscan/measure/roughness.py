"""Roughness of a mesh: the scatter of its vertices about smooth patches, and the part of it that is noise."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cholesky import factorise, solve_lower
from footscan.compiled import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_NEIGHBOURS = 40
"""Bound of memory and time: vertices of a patch."""
SMOOTH = 0.2
"""Least cosine of the angle between two normals of one patch; chosen by hand."""
QUADRATIC, CUBIC = 6, 10
"""Numbers of terms of polynomials in two variables."""
MISFIT_FALLS = 3.0
"""Least factor by which the squared misfit to the form of coarse triangles falls from a quadratic to a cubic. Chosen by
hand."""


class Roughness(NamedTuple):
    """Scatter of the vertices of a mesh about smooth patches."""

    deviation: Floats
    """(V,) standard deviation of the surface around each vertex, mm"""
    noise: Floats
    """(V,) part of it that is noise, mm; the rest is form that the triangles are too coarse for"""


def roughness(vertices: Floats, normals: Floats, faces: NDArray[np.integer]) -> Roughness:
    """Estimate the scatter of the surface around each vertex.

    A cubic is fitted, along the normal of a vertex, to a patch: the vertex, its neighbours and their neighbours. Enough
    patches are fitted that every vertex is the middle of a patch or next to one. The scatter of a patch is the root of
    the sum of squared residuals over its degrees of freedom; a vertex takes the mean square of its patches. Patches
    with an edge in them, such as the rim of a cut, are left out, and vertices without a patch take the median. Noise
    scatters as much about quadratics as about cubics; form scatters more, and so the two are separated.

    Parameters
    ----------
    vertices : (V, 3) float64, mm
    normals : (V, 3) unit vectors
    faces : (F, 3)

    Examples
    --------
    A plane of points, 1 mm apart, is smooth:

    >>> x, y = np.meshgrid(np.arange(9.0), np.arange(9.0))
    >>> plane = np.column_stack([x.ravel(), y.ravel(), np.zeros(81)])
    >>> low = np.array([k for k in range(72) if k % 9 < 8])
    >>> faces = np.concatenate([np.stack([low, low + 1, low + 9], 1), np.stack([low + 1, low + 10, low + 9], 1)])
    >>> bool(roughness(plane, np.tile([0.0, 0, 1], (81, 1)), faces).deviation.max() < 1e-9)
    True
    """
    corners = faces.astype(np.int64)
    variance, ratios = _fits(vertices, normals, corners, *_faces_around(corners, len(vertices)))
    fitted = variance >= 0
    deviation = np.sqrt(np.where(fitted, variance, np.median(variance[fitted]) if fitted.any() else 0.0))
    misfit = (np.median(ratios) - 1.0) / (MISFIT_FALLS - 1.0) if len(ratios) else 0.0
    return Roughness(deviation, deviation * np.sqrt(np.clip(1.0 - misfit, 0.0, 1.0)))


@compiled
def _faces_around(faces: Ints, count: int) -> tuple[Ints, Ints]:
    """Returns (V + 1,) starts and (3F,) faces: those around vertex v are faces[starts[v] : starts[v + 1]]."""
    starts = np.zeros(count + 1, np.int64)
    for vertex in faces.ravel():
        starts[vertex + 1] += 1
    starts = np.cumsum(starts)
    place, around = starts[:-1].copy(), np.empty(faces.size, np.int64)
    for face in range(len(faces)):
        for k in range(3):
            around[place[faces[face, k]]] = face
            place[faces[face, k]] += 1
    return starts, around


@compiled
def _fits(vertices: Floats, normals: Floats, faces: Ints, starts: Ints, around: Ints) -> tuple[Floats, Floats]:
    """Returns (V,) variances, mm², -1 where unknown, and (P,) ratios of quadratic to cubic variance of each patch.

    Parameters
    ----------
    starts, around : as `_faces_around` returns them
    """
    variance, patches = np.zeros(len(vertices)), np.zeros(len(vertices))
    ratios = np.empty(len(vertices))
    fitted = 0
    patch = np.empty(MOST_NEIGHBOURS, np.int64)
    seen, covered = np.full(len(vertices), -1), np.zeros(len(vertices), np.bool_)
    for vertex in range(len(vertices)):
        if covered[vertex]:
            continue
        near, count = _patch(vertex, faces, starts, around, seen, patch)
        for k in range(near):
            covered[patch[k]] = True
        is_smooth = count > CUBIC
        for k in range(count):
            is_smooth = is_smooth and _dot(normals[patch[k]], normals[vertex]) > SMOOTH
        if not is_smooth:
            continue
        quadratic, cubic = _residual_variances(vertices, vertex, normals[vertex], patch[:count])
        if cubic >= 0:
            for k in range(count):
                variance[patch[k]] += cubic
                patches[patch[k]] += 1
            if cubic > 0:
                ratios[fitted] = quadratic / cubic
                fitted += 1
    for vertex in range(len(vertices)):
        variance[vertex] = variance[vertex] / patches[vertex] if patches[vertex] > 0 else -1.0
    return variance, ratios[:fitted]


@compiled
def _patch(vertex: int, faces: Ints, starts: Ints, around: Ints, seen: Ints, patch: Ints) -> tuple[int, int]:
    """Write `vertex`, its neighbours and theirs to `patch`; returns the counts up to the neighbours and of all."""
    patch[0] = vertex
    seen[vertex] = vertex
    near = count = 1
    first = 0
    for ring in range(2):
        last = count
        for place in range(first, last):
            for k in range(starts[patch[place]], starts[patch[place] + 1]):
                for corner in range(3):
                    other = faces[around[k], corner]
                    if seen[other] != vertex and count < MOST_NEIGHBOURS:
                        seen[other] = vertex
                        patch[count] = other
                        count += 1
        first = last
        if ring == 0:
            near = count
    return near, count


@compiled
def _residual_variances(vertices: Floats, vertex: int, normal: Floats, patch: Ints) -> tuple[float, float]:
    """Returns the variances of a patch about its quadratic and its cubic, mm²; -1 if they are undetermined."""
    across, up = _tangents(normal)
    away, scale = np.empty((len(patch), 3)), 0.0
    for k in range(len(patch)):
        for i in range(3):
            away[k, i] = vertices[patch[k], i] - vertices[vertex, i]
            scale = max(scale, abs(away[k, i]))
    if scale == 0.0:
        return -1.0, -1.0
    terms = np.empty(CUBIC)
    matrix, right = np.zeros((CUBIC, CUBIC)), np.zeros(CUBIC)
    squares = 0.0
    for k in range(len(patch)):
        u, v, height = _dot(away[k], across) / scale, _dot(away[k], up) / scale, _dot(away[k], normal)
        terms[0], terms[1], terms[2], terms[3], terms[4], terms[5] = 1.0, u, v, u * u, u * v, v * v
        terms[6], terms[7], terms[8], terms[9] = u * u * u, u * u * v, u * v * v, v * v * v
        squares += height * height
        for i in range(CUBIC):
            right[i] += terms[i] * height
            for j in range(i + 1):
                matrix[i, j] += terms[i] * terms[j]
    if not factorise(matrix):
        return -1.0, -1.0
    solve_lower(matrix, right)
    quadratic = squares
    for i in range(QUADRATIC):
        quadratic -= right[i] * right[i]
    cubic = quadratic
    for i in range(QUADRATIC, CUBIC):
        cubic -= right[i] * right[i]
    return quadratic / (len(patch) - QUADRATIC), max(cubic, 0.0) / (len(patch) - CUBIC)


@compiled
def _tangents(normal: Floats) -> tuple[Floats, Floats]:
    """Returns two unit vectors (3,) that are perpendicular to the normal and to each other."""
    axis = 0
    for i in range(1, 3):
        if abs(normal[i]) < abs(normal[axis]):
            axis = i
    across, up = np.zeros(3), np.empty(3)
    across[axis] = 1.0
    for i in range(3):
        across[i] -= normal[axis] * normal[i]
    length = np.sqrt(_dot(across, across))
    for i in range(3):
        across[i] /= length
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        up[i] = normal[j] * across[k] - normal[k] * across[j]
    return across, up


@compiled
def _dot(first: Floats, second: Floats) -> float:
    """Dot product of (3,) vectors, for which a call of BLAS takes longer."""
    product: float = first[0] * second[0] + first[1] * second[1] + first[2] * second[2]
    return product

"""How rough a mesh is: the scatter of its vertices about smooth patches, and what of it is noise."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_NEIGHBOURS = 40
SMOOTH = 0.2
"""Cosine of the angle between two normals of one patch, at least."""
QUADRATIC, CUBIC = 6, 10
"""Terms of polynomials in two variables."""
MISFIT_FALLS = 3.0
"""By so much less in square than the quadratic a cubic misses the form of coarse triangles, at least."""


class Roughness(NamedTuple):
    """How far vertices lie off smooth patches."""

    deviation: Floats
    """(V,) standard deviation of the surface around each vertex, mm."""
    noise: Floats
    """(V,) what of it is noise, mm; the rest is form that the triangles are too coarse for."""


def roughness(vertices: Floats, normals: Floats, faces: NDArray[np.integer]) -> Roughness:
    """The scatter of the surface around each vertex.

    Cubics are fitted, along the normal of a vertex, to it, its neighbours and theirs, for so many vertices that all
    are a neighbour of one; the root of the mean square of the residuals over the degrees of freedom left is that of the
    patch, and of its vertices, which may be in several. Patches with an edge in them, as a cut leaves one, are left
    out; vertices in no other have the median of all. Quadratics miss noise by as much, but form by more.

    Parameters
    ----------
    vertices, normals : (V, 3) mm, (V, 3) unit vectors
    faces : (F, 3)
    """
    corners = faces.astype(np.int64)
    variance, ratios = _fits(vertices, normals, corners, *_faces_around(corners, len(vertices)))
    known = variance >= 0
    deviation = np.sqrt(np.where(known, variance, np.median(variance[known]) if known.any() else 0.0))
    misfit = (np.median(ratios) - 1.0) / (MISFIT_FALLS - 1.0) if len(ratios) else 0.0
    return Roughness(deviation, deviation * np.sqrt(np.clip(1.0 - misfit, 0.0, 1.0)))


@compiled
def _faces_around(faces: Ints, count: int) -> tuple[Ints, Ints]:
    """(V + 1,) where those of each of `count` vertices start, and (3F,) the faces around all vertices in turn."""
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
    """(V,) variance, -1 where it is not known, and (P,) of each patch, quadratic over cubic. `around`: the faces of all
    vertices, one vertex after another, each from its place in `starts` on."""
    variance, patches = np.zeros(len(vertices)), np.zeros(len(vertices))
    ratios = np.empty(len(vertices))
    fitted = 0
    patch = np.empty(MOST_NEIGHBOURS, np.int64)
    seen, covered = np.full(len(vertices), -1), np.zeros(len(vertices), np.bool_)
    for vertex in range(len(vertices)):
        if covered[vertex]:
            continue
        near, count = _patch(vertex, faces, starts, around, seen, patch)
        covered[patch[:near]] = True
        is_smooth = count > CUBIC
        for k in range(count):
            is_smooth = is_smooth and _dot(normals[patch[k]], normals[vertex]) > SMOOTH
        if not is_smooth:
            continue
        quadratic, cubic = _residual_variances(vertices, vertex, normals[vertex], patch[:count])
        if cubic >= 0:
            variance[patch[:count]] += cubic
            patches[patch[:count]] += 1
            if cubic > 0:
                ratios[fitted] = quadratic / cubic
                fitted += 1
    return np.where(patches > 0, variance / np.maximum(patches, 1), -1.0), ratios[:fitted]


@compiled
def _patch(vertex: int, faces: Ints, starts: Ints, around: Ints, seen: Ints, patch: Ints) -> tuple[int, int]:
    """Fills in `vertex`, its neighbours and theirs; returns how many are the first two, and all."""
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
    """Variance of the patch about its quadratic and about its cubic, mm²; -1 where that is undetermined."""
    axis = np.argmin(np.abs(normal))
    across = np.zeros(3)
    across[axis] = 1.0
    across -= normal[axis] * normal
    across /= np.sqrt(_dot(across, across))
    up = np.cross(normal, across)
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
    if not _eliminated(matrix, right):
        return -1.0, -1.0
    # Of orthogonal terms each takes its own square off the residuals: what Cholesky's method makes of them.
    quadratic = squares - np.sum(right[:QUADRATIC] ** 2)
    cubic = max(quadratic - np.sum(right[QUADRATIC:] ** 2), 0.0)
    return quadratic / (len(patch) - QUADRATIC), cubic / (len(patch) - CUBIC)


@compiled
def _dot(first: Floats, second: Floats) -> float:
    """Of (3,) vectors, for which a call of BLAS takes longer."""
    product: float = first[0] * second[0] + first[1] * second[1] + first[2] * second[2]
    return product


@compiled
def _eliminated(matrix: Floats, right: Floats) -> bool:
    """Turns the normal equations into triangular ones in place; False where they leave the fit undetermined."""
    for i in range(len(right)):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            if i == j:
                if value <= 1e-9 * matrix[i, i]:
                    return False
                matrix[i, i] = np.sqrt(value)
            else:
                matrix[i, j] = value / matrix[j, j]
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    return True

"""Moving of points onto the smooth surface through the points around them (moving least squares).

Alexa et al., "Computing and rendering point set surfaces", 2003, doi:10.1109/TVCG.2003.1175093, with the normal given.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

NEIGHBOURS = 48
BLOCK = 20_000
"""Points whose neighbourhoods are held at once; it bounds the memory."""
SAME_SIDE = 0.3
"""Neighbours whose normals agree less than this (cosine) lie on another side of something thin, as the next toe."""
RIDGE = 1e-3
"""Keeps curvature small where the neighbours do not tell it, as along a single stripe."""

Points = NDArray[np.float64]


def project(points: Points, normals: Points, cloud: Points, cloud_normals: Points, radius: float) -> Points:
    """(N, 3) `points` moved along their normals onto quadratic height fields through the cloud around them.

    A quadratic follows a curved surface; a plane or a mean would shrink toes and heel.

    Parameters
    ----------
    points, normals : (N, 3) mm, unit vectors
    cloud, cloud_normals : (M, 3) mm, unit vectors
    radius : of the neighbourhoods, mm; weights fall to zero there. Points move by a third of it at most.
    """
    tree = KDTree(cloud)
    moved = points.copy()
    for start in range(0, len(points), BLOCK):
        block = slice(start, start + BLOCK)
        nearest = np.arange(1, min(NEIGHBOURS, len(cloud)) + 1)
        distance, neighbours = map(np.asarray, tree.query(points[block], k=nearest, workers=-1))
        normal = normals[block]
        weight = np.clip(1 - (distance / radius) ** 2, 0, None) ** 2
        weight *= np.einsum("nki,ni->nk", cloud_normals[neighbours], normal) > SAME_SIDE
        height = _height_at_origin(cloud[neighbours] - points[block, None], normal, weight, radius)
        moved[block] += np.clip(height, -radius / 3, radius / 3)[:, None] * normal
    return moved


def _height_at_origin(offsets: Points, normal: Points, weight: Points, radius: float) -> Points:
    """(N,) height over the tangent plane, at its origin, of the quadratics fitted to (N, K, 3) `offsets`."""
    helper = np.where(np.abs(normal[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal, first)
    u, v, h = (np.einsum("nki,ni->nk", offsets, axis) for axis in (first, second, normal))
    u, v = u / radius, v / radius
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=2)
    weighted = terms * weight[:, :, None]
    normal_matrix = np.einsum("nki,nkj->nij", weighted, terms) + RIDGE * np.diag([0.0, 1, 1, 1, 1, 1])
    enough = weight.sum(axis=1) > RIDGE
    normal_matrix[~enough] = np.eye(6)
    solution = np.linalg.solve(normal_matrix, np.einsum("nki,nk->ni", weighted, h)[:, :, None])
    return np.where(enough, solution[:, 0, 0], 0.0)

"""Derivatives of landmarks by the displacements of the vertices around them.

Landmarks are summits of polynomials fitted to the surface. Place and height of a summit follow from the coefficients of
the polynomial, which are weighted sums of the heights of the vertices.
"""

import numpy as np
from numpy.typing import NDArray

from footscan.measure.landmarks.extreme import Cap
from footscan.measure.landmarks.polynomial import terms_at

Floats = NDArray[np.float64]

LEAST_VERTICES = 8
"""With fewer vertices in the cap the derivatives are 0; chosen by hand."""
LEAST_FACING = 0.3
"""Least cosine between the normal of a vertex and the direction of height; chosen by hand."""


def summit_gradient(vertices: Floats, normals: Floats, point: Floats, direction: Floats, cap: Cap) -> Floats:
    """Returns (3, V) derivatives of a summit's coordinates by the displacements of the vertices outwards.

    Parameters
    ----------
    vertices : (V, 3) mm
    normals : (V, 3) unit vectors
    point : (3,) mm, the summit
    direction : (3,) unit vector, one of the axes or its opposite
    cap : over which the summit was fitted
    """
    axis = int(np.argmax(np.abs(direction)))
    across = [k for k in range(3) if k != axis]
    gradient = np.zeros((3, len(vertices)))
    near = np.flatnonzero(normals @ direction > LEAST_FACING)
    away = vertices[near] - point
    weights, inside = _weights(away[:, across] @ cap.spread, cap)
    if len(inside) < LEAST_VERTICES:
        return gradient
    which = near[inside]
    moved = 1.0 / (normals[which] @ direction)  # displacement along `direction` where the surface moves outwards by 1
    shift = np.linalg.inv(cap.spread) @ _shift(weights, away[inside] @ direction, cap.depth)
    gradient[axis, which] = weights[0] * moved * direction[axis]
    for k, moves in zip(across, shift * moved, strict=True):
        gradient[k, which] = moves
    return gradient


def saddle_gradient(vertices: Floats, normals: Floats, point: Floats, corner: Floats, cap: Cap) -> Floats:
    """Returns (3, V) derivatives of the point that is nearest, seen from the side, to a corner within; (3,) mm.

    Parameters are those of `summit_gradient`, with the corner instead of a direction.
    """
    gradient = np.zeros((3, len(vertices)))
    reach, start = vertices - corner, point - corner
    distance = np.hypot(reach[:, 0], reach[:, 2])
    ray = reach * [1.0, 0.0, 1.0] / np.maximum(distance, 1e-9)[:, None]
    facing = np.einsum("vi,vi->v", normals, ray)
    nearest, turn = float(np.hypot(start[0], start[2])), float(np.arctan2(start[2], start[0]))
    places = np.column_stack([vertices[:, 1] - point[1], (np.arctan2(reach[:, 2], reach[:, 0]) - turn) * nearest])
    near = np.flatnonzero(facing > LEAST_FACING)
    weights, inside = _weights(places[near] @ cap.spread, cap)
    if len(inside) < LEAST_VERTICES:
        return gradient
    which = near[inside]
    shift = np.linalg.inv(cap.spread) @ _shift(weights, distance[which], cap.depth)
    outwards, along = weights[0] / facing[which], shift[1] / facing[which]
    gradient[0, which] = outwards * np.cos(turn) - along * np.sin(turn)
    gradient[1, which] = shift[0] / facing[which]
    gradient[2, which] = outwards * np.sin(turn) + along * np.cos(turn)
    return gradient


def _weights(places: Floats, cap: Cap) -> tuple[Floats, NDArray[np.intp]]:
    """Returns (15, N) weights from heights to the coefficients of the fit, and (N,) the numbers of the places used.

    Parameters
    ----------
    places : (P, 2) in radii of the cap
    """
    squared = np.einsum("ni,ni->n", places, places)
    inside = np.flatnonzero(squared < 1.0)
    terms, weight = terms_at(places[inside]), (1.0 - squared[inside]) ** 2
    weighted = (terms * weight[:, None]).T
    weights: Floats = np.linalg.solve(weighted @ terms + np.diag(cap.held_back()), weighted)
    return weights, inside


def _second(coefficients: Floats) -> Floats:
    """Returns (2, 2) the second derivatives at the middle."""
    uu, uv, vv = coefficients[3:6]
    return np.array([[2 * uu, uv], [uv, 2 * vv]])


def _shift(weights: Floats, height: Floats, depth: float) -> Floats:
    """Returns (2, N) derivatives by the heights of the place, in radii, where the polynomial is level.

    They are -H⁻¹ times those of the slope, H being the second derivatives. A flat summit is located within a radius:
    the curvature is taken as at least the depth of the cap.
    """
    curvature, axes = np.linalg.eigh(_second(weights @ height))
    steep = np.where(np.abs(curvature) < depth, np.copysign(depth, curvature), curvature)
    moved: Floats = -(axes / steep) @ axes.T @ weights[1:3]
    return moved

"""Projection of points onto the smooth surface through the points around them (moving least squares).

Alexa et al., "Computing and rendering point set surfaces", 2003, doi:10.1109/TVCG.2003.1175093, with quadratic height
fields over planes whose normal follows the surface. A quadratic follows a curved surface; a plane or a mean would
shrink toes and heel.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.cholesky import factorise, solve_factored
from footscan.compiled import compiled
from footscan.mesh.buckets import Buckets, sort_into_cubes
from footscan.side_by_side import Arrays, in_pieces

STEEPEST = 0.35
"""Sine of the least angle between surface and stripe planes by which neighbourhoods grow: a toe is no quadric, and
points farther away say little about it. Chosen by hand."""
ALONG_STRIPES = 0.5
"""Extent of a neighbourhood along the stripes, as a share of that across them: points are dense there, and toes bend
most. Tuned on the nightly suite's four feet, with stripes every 4 mm."""
SAME_SIDE = 0.3
"""Neighbours whose normals agree less than this cosine lie on another surface, such as the next toe; chosen by hand."""
FACING = 0.999
"""Cosine between a normal and the travel above which the direction of the stripes is not known. Chosen by hand."""
RIDGE = 1e-4
"""Keeps the curvature small where the neighbours do not determine it, as along a single stripe. Tuned on the nightly
suite's four feet."""
MOST_MISFIT = 0.1
"""Neighbours lie on one surface if the root mean square of their distances to it is at most this, in distances from
stripe to stripe. If they do not, a point moves to their mean. Tuned on the nightly suite's four feet."""
COARSE_MM = 4.0
"""Of stripes farther apart the limit grows with their distance: skin bends away from a smooth surface by the sagitta
between two stripes, which grows with its square. The distance in the suite on which `MOST_MISFIT` was tuned."""
SECTORS = 8
"""Directions in the tangent plane in which neighbours are counted."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Projection:
    """Points moved onto the surface, with the evidence around them."""

    points: Floats
    """(N, 3) mm"""
    normals: Floats
    """(N, 3) unit normals of the surface there"""
    gap_steps: Floats
    """(N,) distance to the nearest point of the cloud; infinite where none is within reach. Its part along the surface
    across the stripes counts in distances from stripe to stripe there, the rest in steps, since stripes are dense."""
    sectors: NDArray[np.int64]
    """(N,) number of the eight directions in which there are points"""
    nearest: NDArray[np.int64]
    """(N,) number of the nearest point of the cloud; -1 where none is within reach"""
    misfit_steps: Floats
    """(N,) root mean square distance of the neighbours to the surface, in distances from stripe to stripe there, beyond
    `COARSE_MM` relative to their square; infinite where there are none. It is large where neighbours are of two
    surfaces, as in a cleft between toes."""


def project(
    points: Floats,
    normals: Floats,
    cloud: Floats,
    cloud_normals: Floats,
    step_mm: float,
    reach_steps: float,
    rounds: int = 2,
) -> Projection:
    """Move points along their normals onto the surface through a cloud.

    Where the surface is steep, stripes lie farther apart along it, and the neighbourhoods grow in proportion.

    Parameters
    ----------
    points, normals : (N, 3) float64, mm, and (N, 3) unit vectors
    cloud, cloud_normals : (M, 3) float64, mm, and (M, 3) unit vectors, in the same frame
    step_mm : distance from one stripe plane to the next, along X
    reach_steps : radius of the neighbourhoods across the stripes, in distances from stripe to stripe; weights fall to
        zero there, and along the stripes at `ALONG_STRIPES` of it. A point moves by at most half of it in a round
    rounds : each round starts from the points and normals of the round before

    Examples
    --------
    A point 0.3 mm above a plane of points 1 mm apart:

    >>> x, y = np.meshgrid(np.arange(11.0), np.arange(11.0))
    >>> plane = np.column_stack([x.ravel(), y.ravel(), np.zeros(121)])
    >>> up = np.array([[0.0, 0.0, 1.0]])
    >>> placed = project(np.array([[5.2, 5.0, 0.3]]), up, plane, np.repeat(up, 121, axis=0), 1.0, reach_steps=3.0)
    >>> (placed.points.round(2) + 0.0).tolist(), placed.nearest.tolist(), placed.sectors.tolist()
    ([[5.2, 5.0, 0.0]], [60], [8])
    """
    buckets = sort_into_cubes(cloud, reach_steps * step_mm)

    def projected(rows: slice) -> Arrays:
        return _project(points[rows], normals[rows], cloud, cloud_normals, step_mm, reach_steps, rounds, buckets)

    return Projection(*in_pieces(len(points), projected))


@compiled
def _project(  # noqa: PLR0912, PLR0915 (one call per neighbour would cost more than its arithmetic)
    points: Floats,
    normals: Floats,
    cloud: Floats,
    cloud_normals: Floats,
    step: float,
    reach: float,
    rounds: int,
    buckets: Buckets,
) -> tuple[Floats, Floats, Floats, NDArray[np.int64], NDArray[np.int64], Floats]:
    edge, low, dims, start, order = buckets
    count = len(points)
    moved, turned = points.copy(), normals.copy()
    gap, sectors, nearest = np.full(count, np.inf), np.zeros(count, np.int64), np.full(count, -1)
    misfit = np.full(count, np.inf)
    matrix, right, fit, terms = np.empty((6, 6)), np.empty(6), np.empty(6), np.empty(6)
    first, last, offset = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3)
    for n in range(count):
        place, normal = points[n].copy(), normals[n].copy()
        for round_ in range(rounds):
            apart = step / max(np.sqrt(max(1.0 - normal[0] * normal[0], 0.0)), STEEPEST)
            radius = reach * apart
            width = ALONG_STRIPES * radius
            helper = np.zeros(3)
            helper[0 if abs(normal[0]) < FACING else 1] = 1.0
            along = np.cross(normal, helper)  # stripes lie in planes of equal X
            along /= np.sqrt(np.sum(along * along))
            across = np.cross(normal, along)
            matrix[:] = 0.0
            right[:] = 0.0
            closest, closest_point, seen, squares = np.inf, -1, 0, 0.0
            for axis in range(3):
                first[axis] = min(max(int((place[axis] - radius - low[axis]) / edge), 0), dims[axis])
                last[axis] = min(int((place[axis] + radius - low[axis]) / edge), dims[axis] - 1)
            for a in range(first[0], last[0] + 1):
                for b in range(first[1], last[1] + 1):
                    row = (a * dims[1] + b) * dims[2]
                    for at in range(start[row + first[2]], start[row + max(last[2] + 1, first[2])]):
                        near = order[at]
                        squared, agreement = 0.0, 0.0
                        for axis in range(3):
                            offset[axis] = cloud[near, axis] - place[axis]
                            squared += offset[axis] * offset[axis]
                            agreement += cloud_normals[near, axis] * normal[axis]
                        if squared >= radius * radius or agreement < SAME_SIDE:
                            continue
                        u, v, height = 0.0, 0.0, 0.0
                        for axis in range(3):
                            u += offset[axis] * along[axis]
                            v += offset[axis] * across[axis]
                            height += offset[axis] * normal[axis]
                        away = (u * u + height * height) / (step * step) + v * v / (apart * apart)
                        if away < closest:
                            closest, closest_point = away, near
                        seen |= 1 << min(int((np.arctan2(v, u) / (2.0 * np.pi) + 0.5) * SECTORS), SECTORS - 1)
                        u, v = u / width, v / radius
                        inside = 1.0 - u * u - v * v - height * height / (radius * radius)
                        if inside <= 0.0:
                            continue
                        weight = inside * inside
                        squares += weight * height * height
                        terms[0], terms[1], terms[2] = 1.0, u, v
                        terms[3], terms[4], terms[5] = u * u, u * v, v * v
                        for r in range(6):
                            right[r] += weight * terms[r] * height
                            for c in range(r + 1):
                                matrix[r, c] += weight * terms[r] * terms[c]
            if matrix[0, 0] < RIDGE:
                closest_point = -1
                break
            total = matrix[0, 0]
            for r in range(6):
                matrix[r, r] += RIDGE if r else 0.0
                fit[r] = right[r]
            factorise(matrix)
            solve_factored(matrix, fit)
            for r in range(6):
                squares -= fit[r] * right[r]
            scatter = np.sqrt(max(squares, 0.0) / total) / (apart * max(1.0, step / COARSE_MM))
            if scatter > MOST_MISFIT:
                fit[0], fit[1], fit[2] = right[0] / total, 0.0, 0.0
            height = min(max(fit[0], -radius / 2), radius / 2)
            length = 0.0
            for axis in range(3):
                place[axis] += height * normal[axis]
                normal[axis] -= fit[1] * along[axis] / width + fit[2] * across[axis] / radius
                length += normal[axis] * normal[axis]
            for axis in range(3):
                normal[axis] /= np.sqrt(length)
            if round_ == rounds - 1:
                for axis in range(3):
                    moved[n, axis], turned[n, axis] = place[axis], normal[axis]
                gap[n], nearest[n] = np.sqrt(closest), closest_point
                misfit[n] = scatter
                for sector in range(SECTORS):
                    sectors[n] += (seen >> sector) & 1
    return moved, turned, gap, sectors, nearest, misfit

"""Refinement of a rough cuboid: assignment of points to faces, and least-squares directions and places of the faces."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from footscan.verify.shapes.fitting import Floats, robust_deviation

Indices = NDArray[np.intp]
Face = tuple[int, int]
"""Number of the axis, and 0 for its lower or 1 for its upper face."""

COARSE_MM = (3.0, 2.0, 1.5, 1.0, 1.0)
"""Distance from a face within which its points lie, for each coarse pass; later it follows from the noise. Chosen by
hand."""
COARSE_POINTS = 100_000
"""Bound of time: points of the coarse passes."""
FINE_PASSES = 6
"""Bound of time: passes with all points."""
REACH_SIGMAS = 6.0
"""Distance from a face within which its points lie, in robust standard deviations; chosen by hand."""
REACH_MM = (0.3, 3.0)
"""Bounds of that distance; chosen by hand."""
OUTLIER_SIGMAS = 4.0
"""Points farther off than this number of robust standard deviations are outliers; chosen by hand."""
LEAST_POINTS = 30
"""Least number of points of a face; chosen by hand."""
EXTENT_PERCENT = 0.2
"""Percentage of the points on the adjacent faces that lie beyond the provisional end at an unseen face. Chosen by
hand."""
SPARSE_MM = 0.5
"""Largest standard deviation of the points of a face with too few points for a patch; chosen by hand."""


@dataclass(frozen=True)
class FacePoints:
    """The points of one face."""

    face: Face
    kept: Indices
    """Points to which the face is fitted"""
    near_edge: Indices
    """Points near the edges of the face"""
    outliers: int
    """Number of outliers"""
    sigma_mm: float
    """Robust standard deviation of the points' distances, outliers included"""


@dataclass(frozen=True)
class Box:
    """A cuboid with the points of its faces."""

    axes: Floats
    """(3, 3) unit vectors as rows"""
    limits: Floats
    """(3, 2) mm, places of the lower and upper faces along the axes; NaN for a face that was not seen"""
    bounds: Floats
    """(3, 2) mm, the limits; for an unseen face, the reach of the points on the adjacent faces"""
    faces: list[FacePoints]


def refine_box(points: Floats, axes: Floats, limits: Floats, edge_mm: float) -> Box:
    """Fit the cuboid with right angles to `points` by least squares, without outliers and edges.

    Parameters
    ----------
    points : (N, 3) float64, mm
    axes, limits : (3, 3) and (3, 2) mm, of a rough cuboid, accurate to some degrees and millimetres
    edge_mm : points nearer than this to an edge are left out
    """
    thinned = points[:: max(1, len(points) // COARSE_POINTS)]
    for reach in COARSE_MM:
        box = _assigned(thinned, axes, limits, edge_mm, np.full((3, 2), reach))
        axes, limits = _fitted(thinned, box)
    for face, place in _sparse_faces(points, axes, limits, edge_mm).items():
        limits[face] = place
    reaches = np.full((3, 2), COARSE_MM[-1])
    for _ in range(FINE_PASSES):
        box = _assigned(points, axes, limits, edge_mm, reaches)
        axes, limits = _fitted(points, box)
        for of_face in box.faces:
            reaches[of_face.face] = np.clip(REACH_SIGMAS * of_face.sigma_mm, *REACH_MM)
    return _assigned(points, axes, limits, edge_mm, reaches)


def _assigned(points: Floats, axes: Floats, limits: Floats, edge_mm: float, reaches: Floats) -> Box:
    """Assign to each face the points within its distance in `reaches`, (3, 2) mm, and inside its edges."""
    along = points @ axes.T
    bounds = _bounds(along, limits)
    faces = []
    for axis, side in np.argwhere(np.isfinite(limits)).tolist():
        distance = along[:, axis] - limits[axis, side]
        reach = reaches[axis, side]
        others = [k for k in range(3) if k != axis]
        to_edge = np.minimum(along - bounds[:, 0], bounds[:, 1] - along)[:, others].min(axis=1)
        within = np.abs(distance) <= reach
        inside = np.flatnonzero(within & (to_edge >= edge_mm))
        if len(inside) < LEAST_POINTS:
            continue
        sigma = robust_deviation(distance[inside])
        kept = inside[np.abs(distance[inside] - np.median(distance[inside])) <= OUTLIER_SIGMAS * sigma + 1e-9]
        if len(kept) < LEAST_POINTS:
            continue
        far = np.count_nonzero((np.abs(distance) <= REACH_MM[1]) & (to_edge >= edge_mm)) - len(kept)
        near_edge = np.flatnonzero(within & (to_edge < edge_mm) & (to_edge >= -COARSE_MM[-1]))
        faces.append(FacePoints((axis, side), kept, near_edge, int(far), sigma))
    return Box(axes, limits, bounds, faces)


def _bounds(along: Floats, limits: Floats) -> Floats:
    """Returns (3, 2) the limits; for an unseen face, the reach of the points on the adjacent faces."""
    bounds = limits.copy()
    for axis, side in np.argwhere(np.isnan(limits)).tolist():
        beside = np.zeros(len(along), np.bool_)
        for other in range(3):
            if other != axis:
                distance = np.abs(along[:, other, None] - limits[other])  # comparisons with NaN are false
                beside |= (distance <= COARSE_MM[-1]).any(axis=1)
        share = 100 - EXTENT_PERCENT if side else EXTENT_PERCENT
        bounds[axis, side] = np.percentile(along[beside, axis] if beside.any() else along[:, axis], share)
    return bounds


def _fitted(points: Floats, box: Box) -> tuple[Floats, Floats]:
    """Returns axes and limits after one Gauss-Newton step on the distances of the kept points to their faces."""
    normal_matrix, gradient = np.zeros((3, 3)), np.zeros(3)
    for of_face in box.faces:
        centred = points[of_face.kept] - points[of_face.kept].mean(axis=0)
        normal = box.axes[of_face.face[0]]
        lever = np.cross(normal, centred)  # d(normal . p) of a small rotation w is w . (normal x p)
        normal_matrix += lever.T @ lever
        gradient += lever.T @ (centred @ normal)
    turn = Rotation.from_rotvec(-np.linalg.lstsq(normal_matrix, gradient, rcond=1e-9)[0])
    axes = np.asarray(turn.apply(box.axes), np.float64)
    limits = np.full((3, 2), np.nan)
    for of_face in box.faces:
        limits[of_face.face] = np.mean(points[of_face.kept] @ axes[of_face.face[0]])
    return axes, limits


def _sparse_faces(points: Floats, axes: Floats, limits: Floats, edge_mm: float) -> dict[Face, float]:
    """Find the places of faces across the travel that only one or two stripes hit.

    Their points have no neighbours for a normal. But points there, well between the edges, can only belong to the face.
    """
    along = points @ axes.T
    bounds = _bounds(along, limits)
    sparse: dict[Face, float] = {}
    for axis, side in np.argwhere(np.isnan(limits)).tolist():
        others = [k for k in range(3) if k != axis]
        to_edge = np.minimum(along - bounds[:, 0], bounds[:, 1] - along)[:, others].min(axis=1)
        near = np.abs(along[:, axis] - bounds[axis, side]) <= COARSE_MM[0]
        places = along[near & (to_edge >= edge_mm), axis]
        if len(places) >= LEAST_POINTS and robust_deviation(places) <= SPARSE_MM:
            sparse[axis, side] = float(np.median(places))
    return sparse

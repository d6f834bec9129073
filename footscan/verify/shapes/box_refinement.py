"""A rough cuboid brought onto its points: which point belongs to which face, and the best directions and places."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from footscan.verify.shapes.fitting import Floats, robust_deviation

Indices = NDArray[np.intp]
Face = tuple[int, int]
"""Number of the axis, and 0 for its lower or 1 for its upper face."""

COARSE_MM = (3.0, 2.0, 1.5, 1.0, 1.0)
"""How far from a face its points are sought, pass by pass; thereafter it follows from the noise."""
COARSE_POINTS = 100_000
FINE_PASSES = 6
REACH_SIGMAS = 6.0
REACH_MM = (0.3, 3.0)
OUTLIER_SIGMAS = 4.0
LEAST_POINTS = 30
EXTENT_PERCENT = 0.2
"""Beyond the end for the time being of a cuboid where nothing sees its face lie so many of the points beside."""
SPARSE_MM = 0.5
"""Largest standard deviation of the points of a face that has too few for a patch with a normal."""


@dataclass(frozen=True)
class FacePoints:
    """What belongs to one face."""

    face: Face
    kept: Indices
    """The points that it is fitted to."""
    near_edge: Indices
    outliers: int
    sigma_mm: float
    """Robust standard deviation of their distances."""


@dataclass(frozen=True)
class Box:
    """A cuboid."""

    axes: Floats
    """(3, 3) unit vectors as rows."""
    limits: Floats
    """(3, 2) mm, where along the axes its lower and upper faces stand; NaN for one that was not seen."""
    bounds: Floats
    """(3, 2) mm, the same and, where it is NaN, how far the points on the faces beside it reach."""
    faces: list[FacePoints]


def refine_box(points: Floats, axes: Floats, limits: Floats, edge_mm: float) -> Box:
    """The cuboid with right angles that fits `points` best in least squares, outliers and edges left out.

    Parameters
    ----------
    points : (N, 3) float64, mm
    axes, limits : of a rough cuboid, good to some degrees and millimetres
    edge_mm : points nearer than this to an edge are left out
    """
    some = points[:: max(1, len(points) // COARSE_POINTS)]
    for reach in COARSE_MM:
        box = _assigned(some, axes, limits, edge_mm, np.full((3, 2), reach))
        axes, limits = _fitted(some, box)
    for face, place in _sparse_faces(points, axes, limits, edge_mm).items():
        limits[face] = place
    reaches = np.full((3, 2), COARSE_MM[-1])
    for _ in range(FINE_PASSES):
        box = _assigned(points, axes, limits, edge_mm, reaches)
        axes, limits = _fitted(points, box)
        for found in box.faces:
            reaches[found.face] = np.clip(REACH_SIGMAS * found.sigma_mm, *REACH_MM)
    return _assigned(points, axes, limits, edge_mm, reaches)


def _assigned(points: Floats, axes: Floats, limits: Floats, edge_mm: float, reaches: Floats) -> Box:
    """The points that lie within `reaches`, (3, 2) mm, of each face and inside of its edges."""
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
    """`limits`, and how far the points on the faces beside reach where there is none."""
    bounds = limits.copy()
    for axis, side in np.argwhere(np.isnan(limits)).tolist():
        beside = np.zeros(len(along), np.bool_)
        for other in range(3):
            if other != axis:
                distance = np.abs(along[:, other, None] - limits[other])  # NaN is near to nothing
                beside |= (distance <= COARSE_MM[-1]).any(axis=1)
        share = 100 - EXTENT_PERCENT if side else EXTENT_PERCENT
        bounds[axis, side] = np.percentile(along[beside, axis] if beside.any() else along[:, axis], share)
    return bounds


def _fitted(points: Floats, box: Box) -> tuple[Floats, Floats]:
    """Axes and limits after one step of Gauss and Newton on the distances of the kept points to their faces."""
    normal_matrix, gradient = np.zeros((3, 3)), np.zeros(3)
    for found in box.faces:
        centred = points[found.kept] - points[found.kept].mean(axis=0)
        normal = box.axes[found.face[0]]
        lever = np.cross(normal, centred)  # d(normal . p) of a small turn w is w . (normal x p)
        normal_matrix += lever.T @ lever
        gradient += lever.T @ (centred @ normal)
    turn = Rotation.from_rotvec(-np.linalg.lstsq(normal_matrix, gradient, rcond=1e-9)[0])
    axes = np.asarray(turn.apply(box.axes), np.float64)
    limits = np.full((3, 2), np.nan)
    for found in box.faces:
        limits[found.face] = np.mean(points[found.kept] @ axes[found.face[0]])
    return axes, limits


def _sparse_faces(points: Floats, axes: Floats, limits: Floats, edge_mm: float) -> dict[Face, float]:
    """Faces across the travel that only a stripe or two hit, and where they stand.

    Their points have no neighbours to give them a normal. But there, well between the edges, nothing else can lie.
    """
    along = points @ axes.T
    bounds = _bounds(along, limits)
    found: dict[Face, float] = {}
    for axis, side in np.argwhere(np.isnan(limits)).tolist():
        others = [k for k in range(3) if k != axis]
        to_edge = np.minimum(along - bounds[:, 0], bounds[:, 1] - along)[:, others].min(axis=1)
        near = np.abs(along[:, axis] - bounds[axis, side]) <= COARSE_MM[0]
        places = along[near & (to_edge >= edge_mm), axis]
        if len(places) >= LEAST_POINTS and robust_deviation(places) <= SPARSE_MM:
            found[axis, side] = float(np.median(places))
    return found

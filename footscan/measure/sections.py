"""Plane sections of a mesh, and the girth of a tape around one."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, distance_matrix

from footscan.surface.topology import directed_edges


class Section(NamedTuple):
    """Where a plane cuts a mesh."""

    points: NDArray[np.float64]
    """(S, 3) where the plane cuts an edge of the mesh, mm."""
    ends: NDArray[np.float64]
    """(E, 3) those of them at which the curve ends since the mesh does; none where it is closed."""


def cut(
    vertices: NDArray[np.float64], faces: NDArray[np.integer], point: NDArray[np.float64], normal: NDArray[np.float64]
) -> Section:
    """The section of a mesh, (V, 3) mm and (F, 3), with the plane through (3,) `point` across (3,) `normal`."""
    height = (vertices - point) @ normal
    above = height >= 0
    crossing = np.ptp(above[faces].astype(np.int8), axis=1) > 0
    edges = np.sort(directed_edges(faces[crossing]), axis=1)
    edges, faces_at = np.unique(edges[above[edges[:, 0]] != above[edges[:, 1]]], axis=0, return_counts=True)
    start, end = edges.T
    share = (height[start] / (height[start] - height[end]))[:, None]
    points = vertices[start] + share * (vertices[end] - vertices[start])
    return Section(points, points[faces_at == 1])


def below(section: Section, height: float) -> Section:
    """The part of `section` up to `height` in mm above the floor; an opening higher up is of no account for it."""
    return Section(section.points[section.points[:, 2] <= height], section.ends[section.ends[:, 2] <= height])


def tape_girth(section: Section, normal: NDArray[np.float64]) -> float | None:
    """Length in mm of a taut tape around the section, which bridges hollows: the perimeter of its convex hull.

    None where the section holds no area.
    """
    across = np.cross(normal, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    plane = np.column_stack([section.points @ across, section.points @ np.cross(across, normal)])
    if len(plane) < 3:
        return None
    try:
        return float(ConvexHull(plane).area)  # of a plane figure qhull's "area" is the perimeter
    except QhullError:
        return None


def widest_gap(section: Section) -> float:
    """Length in mm of the widest opening of the section: ends are joined to the nearest first."""
    gaps = distance_matrix(section.ends, section.ends)
    np.fill_diagonal(gaps, np.inf)
    widest = 0.0
    while np.isfinite(gaps).any():
        first, second = np.unravel_index(np.argmin(gaps), gaps.shape)
        widest = float(gaps[first, second])
        gaps[[first, second], :] = gaps[:, [first, second]] = np.inf
    return widest

"""The cross-section of the reference object as edges, and the edge nearest to a point."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

STRAIGHT_MM = 1e-6
"""Distance of a corner from the line between its neighbours up to which the profile is straight there: rounding."""
BELOW_MM = 0.5
"""Depth below the glass from which a placement is doubtful. Chosen by hand."""
FAR_MM = 250.0
"""Distance from the middle of the glass that no foot reaches. Chosen by hand."""
BLOCK = 1024
"""Points that are processed at a time, so that their data stay in the fastest cache: a bound of time."""


@dataclass(frozen=True)
class Edges:
    """The straight edges of a closed profile, counter-clockwise as seen from +X, in the object's own frame."""

    start: Floats
    """(E, 2) Y and Z in mm."""
    end: Floats
    """(E, 2) mm; the start of the next edge."""
    normal: Floats
    """(E, 2) unit vectors that point out of the object."""
    offset: Floats
    """(E,) mm: an edge lies on the line `normal` . (Y, Z) = `offset`."""
    length: Floats
    """(E,) mm."""


def edges_of(profile: Sequence[Sequence[float]]) -> Edges:
    """Compute the edges of a simple polygon of corners (Y, Z), mm, in either direction; collinear edges are joined.

    >>> square = edges_of([[0, 0], [0, 10], [10, 10], [10, 0], [5, 0]])
    >>> square.start.tolist()
    [[10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [0.0, 0.0]]
    >>> square.offset.tolist()
    [10.0, 10.0, 0.0, 0.0]
    """
    corners = np.asarray(profile, dtype=np.float64)
    start = _true_corners(corners if _signed_area(corners) > 0.0 else corners[::-1])
    end = np.roll(start, -1, axis=0)
    way = end - start
    length = np.hypot(way[:, 0], way[:, 1])
    normal = np.column_stack([way[:, 1], -way[:, 0]]) / length[:, np.newaxis] + 0.0  # no negative zeros
    return Edges(start, end, normal, np.sum(normal * start, axis=1), length)


def placement_doubts(profile: Sequence[Sequence[float]], placements: Sequence[Sequence[float]]) -> list[str]:
    """Describe possible mistakes in the `placements` (dY, dZ), mm, of a profile of corners (Y, Z), mm.

    >>> placement_doubts([[0, 0], [10, 0], [10, 10]], [[0, 0], [0, -3]])
    ['placement 1 reaches down to Z = -3 mm, below the glass at 0']
    """
    doubts = []
    for number, (shift_y, shift_z) in enumerate(placements):
        lowest, highest = min(z for _, z in profile) + shift_z, max(z for _, z in profile) + shift_z
        aside = max(abs(y + shift_y) for y, _ in profile)
        if lowest < -BELOW_MM:
            doubts.append(f"placement {number} reaches down to Z = {lowest:g} mm, below the glass at 0")
        if aside > FAR_MM or highest > FAR_MM:
            doubts.append(f"placement {number} reaches out to {max(aside, highest):g} mm, far from where feet stand")
    return doubts


def nearest_edge(edges: Edges, points: Floats) -> tuple[Indices, Floats, Floats]:
    """Find the edge nearest to each of `points` (N, 2), Y and Z in mm, in the object's own frame.

    The nearest edge is found by the distance from the edge itself; the returned distance is from its line. A point
    beyond a corner of the object is equally far from both edges there, and is assigned to either of them.

    Returns
    -------
    index : (N,) number of the edge.
    distance : (N,) float64, mm, from the edge's line, positive outside; NaN for a point that is not finite.
    along : (N,) float64, mm, from the edge's start; below 0 or above its length for a point beyond its ends.

    Examples
    --------
    >>> square = edges_of([[0, 0], [10, 0], [10, 10], [0, 10]])
    >>> index, distance, along = nearest_edge(square, np.array([[12.0, 4.0]]))
    >>> print(square.normal[index], distance, along)
    [[1. 0.]] [2.] [4.]
    """
    nearest: tuple[Indices, Floats, Floats] = _nearest(
        edges.start, edges.normal, edges.offset, edges.length, np.ascontiguousarray(points, np.float64)
    )
    return nearest


def _signed_area(corners: Floats) -> float:
    """The area of a polygon of corners (N, 2), positive if they are counter-clockwise."""
    y, z = (corners - corners[0]).T
    return float(np.sum(y * np.roll(z, -1) - z * np.roll(y, -1)) / 2.0)


def _true_corners(corners: Floats) -> Floats:
    """The corners at which the profile turns."""
    before, behind = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    chord, arm = behind - before, corners - before
    height = np.abs(chord[:, 0] * arm[:, 1] - chord[:, 1] * arm[:, 0]) / np.hypot(chord[:, 0], chord[:, 1])
    return np.ascontiguousarray(corners[height > STRAIGHT_MM])


@compiled
def _nearest(
    start: Floats, normal: Floats, offset: Floats, length: Floats, points: Floats
) -> tuple[Indices, Floats, Floats]:
    """The result of `nearest_edge`."""
    # An edge runs along its normal, turned by 90 degrees counter-clockwise.
    origin = start[:, 1] * normal[:, 0] - start[:, 0] * normal[:, 1]
    count = len(points)
    index = np.empty(count, np.intp)
    distance, along = np.empty(count), np.empty(count)
    y, z, least, nearest = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    for first in range(0, count, BLOCK):
        size = min(BLOCK, count - first)
        for p in range(size):
            y[p], z[p] = points[first + p]
            least[p], nearest[p] = np.inf, 0.0
        for e in range(len(offset)):
            n_y, n_z, line, zero, whole = normal[e, 0], normal[e, 1], offset[e], origin[e], length[e]
            for p in range(size):  # without a branch, so that the compiler vectorises the loop
                off = n_y * y[p] + n_z * z[p] - line
                reach = n_y * z[p] - n_z * y[p] - zero
                beyond = -reach if -reach > reach - whole else reach - whole
                beyond = beyond if beyond > 0.0 else 0.0
                squared = off * off + beyond * beyond
                nearer = squared < least[p]
                least[p] = squared if nearer else least[p]
                nearest[p] = e if nearer else nearest[p]
        for p in range(size):
            e = int(nearest[p])
            index[first + p] = e
            distance[first + p] = normal[e, 0] * y[p] + normal[e, 1] * z[p] - offset[e]
            along[first + p] = normal[e, 0] * z[p] - normal[e, 1] * y[p] - origin[e]
    return index, distance, along

"""Stripe points that lie on known edges of the reference object."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.reference import Edges, nearest_edge
from footscan.calibration.models.observations import Observations
from footscan.rows import distinct_rows

Floats = NDArray[np.float64]

CORNER_MM = 1.8
"""Distance from a corner, about 6 px, within which the stripe's centre is biased. Chosen by hand."""
BLOCK_MM = 2.0
"""Length of the blocks along an edge, within which errors are correlated: neighbours share speckle and pixels. Chosen
by hand."""
SHORTEST_MM = 4.0
"""Length from which a stretch of an edge is used; a shorter one may be another object. Chosen by hand."""
FEWEST_GROUPS = 12
"""Number of edges from which whole edges are held out; with fewer, parts of edges are. Chosen by hand."""
PARTS = 4
"""Parts of an edge that are held out in turn."""
LEAST_EXTENT_MM = 1e-9
"""Lower bound of the extent of an edge by which is divided."""


@dataclass(frozen=True)
class EdgePoints:
    """Points of the stripe of one camera, each assigned to an edge."""

    pixels: Floats
    """(N, 2) px."""
    placement: NDArray[np.intp]
    """(N,) number of the placement."""
    edge: NDArray[np.intp]
    """(N,) number of the edge."""
    along: Floats
    """(N,) position on the edge from its start, mm."""
    normals: Floats
    """(N, 2) of the edges, outward."""
    offsets: Floats
    """(N,) normal . (Y, Z) = offset in this placement, mm."""

    def __len__(self) -> int:
        return len(self.offsets)

    def across(self, world: Floats) -> Floats:
        """Distances (N,), mm, of the points from their edges if they lie at `world` (N, 2), mm; positive outside."""
        return np.asarray(np.sum(self.normals * world, axis=1) - self.offsets)

    def part(self, chosen: NDArray[np.bool_]) -> "EdgePoints":
        """The points selected by `chosen` (N,)."""
        return EdgePoints(
            self.pixels[chosen], self.placement[chosen], self.edge[chosen],
            self.along[chosen], self.normals[chosen], self.offsets[chosen],
        )  # fmt: skip

    def placed(self, edges: Edges, poses: Floats) -> "EdgePoints":
        """The same points, with the object in other `poses` (K, 3), mm, mm and radians."""
        normals, offsets = edge_lines(edges, poses, self.edge, self.placement)
        return replace(self, normals=normals, offsets=offsets)

    def observations(self) -> Observations:
        """The observations for a fit; whole edges are groups if enough were seen, else parts of edges."""
        edges = distinct_rows(np.column_stack([self.placement, self.edge])).rows
        block = np.floor(self.along / BLOCK_MM).astype(np.intp)
        whole = self.placement * (self.edge.max(initial=0) + 1) + self.edge
        if len(edges) >= FEWEST_GROUPS:
            group = whole
        else:
            part = np.zeros(len(self), np.intp)
            for number in np.unique(whole):
                members = whole == number
                low, high = self.along[members].min(), self.along[members].max()
                share = (self.along[members] - low) / max(high - low, LEAST_EXTENT_MM)
                part[members] = np.minimum((PARTS * share).astype(np.intp), PARTS - 1)
            group = whole * PARTS + part
        blocks = distinct_rows(np.column_stack([group, block])).number
        return Observations(self.pixels, self.normals, self.offsets, np.arange(len(self)), blocks, group)


def edge_points(
    stripes: Sequence[Floats],
    to_world: Callable[[Floats], Floats],
    edges: Edges,
    poses: Floats,
    gate_mm: float,
) -> EdgePoints:
    """Select the points of the stripe that a map brings within `gate_mm` of an edge, away from corners.

    Parameters
    ----------
    stripes : for each of K placements the points (N, 2), px.
    to_world : maps pixels (N, 2) to Y and Z (N, 2), mm.
    poses : (K, 3) shift of the object in Y and Z, mm, and its rotation about X, radians, in each placement.

    Examples
    --------
    A horizontal edge at Z = 10 mm, seen with 1 mm a px, the image turned over; the last point is too far away:

    >>> from footscan.calibration.capture.reference import edges_of
    >>> square = edges_of([[0, 0], [10, 0], [10, 10], [0, 10]])
    >>> stripe = np.array([[3.0, -10.1], [5.0, -10.0], [7.0, -9.9], [8.0, -10.2], [5.0, -14.0]])
    >>> points = edge_points([stripe], lambda pixels: pixels * [1.0, -1.0], square, np.zeros((1, 3)), gate_mm=0.5)
    >>> print(len(points), points.normals[0], points.across(points.pixels * [1.0, -1.0]).round(3))
    4 [0. 1.] [ 0.1  0.  -0.1  0.2]
    """
    pixels = np.concatenate([np.empty((0, 2)), *stripes])
    placement = np.repeat(np.arange(len(stripes)), [len(stripe) for stripe in stripes])
    index, distance, along = nearest_edge(edges, to_object(to_world(pixels), poses[placement]))
    near = np.abs(distance) < gate_mm
    near &= (along > CORNER_MM) & (along < edges.length[index] - CORNER_MM)
    near &= _on_a_stretch(placement, index, along, near)
    normals, offsets = edge_lines(edges, poses, index, placement)
    return EdgePoints(pixels, placement, index, along, normals, offsets).part(near)


def edge_distances(edges: Edges, points: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Find the edge nearest to each of `points` (N, 2), mm, in the object's frame, and the distance from it; (N,) each.

    >>> from footscan.calibration.capture.reference import edges_of
    >>> square = edges_of([[0, 0], [10, 0], [10, 10], [0, 10]])
    >>> print(edge_distances(square, np.array([[5.0, 12.0], [13.0, 14.0]]))[1])
    [2. 5.]
    """
    index, off, along = nearest_edge(edges, points)
    beyond = np.maximum(np.maximum(-along, along - edges.length[index]), 0.0)
    return index, np.hypot(off, beyond)


def to_object(world: Floats, poses: Floats) -> Floats:
    """Transform points (N, 2), mm, from the scanner's frame to the frame of the object in `poses` (N, 3)."""
    rest = world - poses[:, :2]
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.column_stack([cos * rest[:, 0] + sin * rest[:, 1], cos * rest[:, 1] - sin * rest[:, 0]])


def from_object(points: Floats, pose: Floats) -> Floats:
    """Transform points (N, 2), mm, from the frame of the object in `pose` (3,) to the scanner's frame.

    >>> print(from_object(np.array([[10.0, 0.0]]), np.array([1.0, 2.0, np.pi / 2])).round(6))
    [[ 1. 12.]]
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]) + pose[:2])


def edge_lines(
    edges: Edges, poses: Floats, edge: NDArray[np.intp], placement: NDArray[np.intp]
) -> tuple[Floats, Floats]:
    """Compute the normals (N, 2) and offsets (N,), mm, of the lines of edges for the object in `poses` (K, 3)."""
    cos, sin = np.cos(poses[placement, 2]), np.sin(poses[placement, 2])
    n_y, n_z = edges.normal[edge].T
    normals = np.column_stack([cos * n_y - sin * n_z, sin * n_y + cos * n_z])
    return normals, edges.offset[edge] + np.sum(normals * poses[placement, :2], axis=1)


def _on_a_stretch(
    placement: NDArray[np.intp], edge: NDArray[np.intp], along: Floats, near: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Select the points (N,) on edges of which the near points cover a stretch of `SHORTEST_MM`."""
    number = distinct_rows(np.column_stack([placement, edge])).number
    low = np.full(number.max(initial=-1) + 1, np.inf)
    high = -low
    np.minimum.at(low, number[near], along[near])
    np.maximum.at(high, number[near], along[near])
    return np.asarray((high - low >= SHORTEST_MM)[number])

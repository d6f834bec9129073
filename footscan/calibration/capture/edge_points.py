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
"""So near to a corner, about 6 px, the stripe's centre is drawn round it."""
BLOCK_MM = 2.0
"""Neighbours on the stripe err alike: speckle, and the pixels that they share."""
SHORTEST_MM = 4.0
"""A shorter stretch of an edge says little, and may be something else."""
FEWEST_GROUPS = 12
"""With fewer edges seen, parts of edges are held out, not whole ones."""
PARTS = 4


@dataclass(frozen=True)
class EdgePoints:
    """Points of the stripe of one camera, each with the edge that it belongs to."""

    pixels: Floats
    """(N, 2) px."""
    placement: NDArray[np.intp]
    """(N,)."""
    edge: NDArray[np.intp]
    """(N,)."""
    along: Floats
    """(N,) position on the edge from its start, mm."""
    normals: Floats
    """(N, 2) of the edges, outward."""
    offsets: Floats
    """(N,) normal . (Y, Z) = offset in this placement, mm."""

    def __len__(self) -> int:
        return len(self.offsets)

    def across(self, world: Floats) -> Floats:
        """How far off their edges `world` (N, 2), mm, places them, (N,), positive outside."""
        return np.asarray(np.sum(self.normals * world, axis=1) - self.offsets)

    def part(self, chosen: NDArray[np.bool_]) -> "EdgePoints":
        """Those that are chosen, (N,)."""
        return EdgePoints(
            self.pixels[chosen], self.placement[chosen], self.edge[chosen],
            self.along[chosen], self.normals[chosen], self.offsets[chosen],
        )  # fmt: skip

    def placed(self, edges: Edges, poses: Floats) -> "EdgePoints":
        """The same points, with the object in other `poses` (K, 3)."""
        normals, offsets = edge_lines(edges, poses, self.edge, self.placement)
        return replace(self, normals=normals, offsets=offsets)

    def observations(self) -> Observations:
        """What a map is fitted to; whole edges are held out where enough were seen, or else parts of them."""
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
                share = (self.along[members] - low) / max(high - low, 1e-9)
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
    """The points of the stripe that a map brings within `gate_mm` of an edge, away from corners.

    Parameters
    ----------
    stripes : for each of K placements the points (N, 2), px.
    to_world : pixels (N, 2) to Y and Z (N, 2), mm.
    poses : (K, 3) shift of the object in Y and Z, mm, and its turn about X, radians, in each placement.
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
    """The edge nearest to each of `points` (N, 2), mm, as the object sees them, and the distance from it, (N,) each."""
    index, off, along = nearest_edge(edges, points)
    beyond = np.maximum(np.maximum(-along, along - edges.length[index]), 0.0)
    return index, np.hypot(off, beyond)


def to_object(world: Floats, poses: Floats) -> Floats:
    """Points (N, 2), mm, as the object sees them that stands in `poses` (N, 3)."""
    rest = world - poses[:, :2]
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.column_stack([cos * rest[:, 0] + sin * rest[:, 1], cos * rest[:, 1] - sin * rest[:, 0]])


def from_object(points: Floats, pose: Floats) -> Floats:
    """Where points (N, 2) of the object are, mm, when it stands in `pose` (3,)."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]) + pose[:2])


def edge_lines(
    edges: Edges, poses: Floats, edge: NDArray[np.intp], placement: NDArray[np.intp]
) -> tuple[Floats, Floats]:
    """Normals (N, 2) and offsets (N,), mm, of the lines that edges lie on when the object stands in `poses` (K, 3)."""
    cos, sin = np.cos(poses[placement, 2]), np.sin(poses[placement, 2])
    n_y, n_z = edges.normal[edge].T
    normals = np.column_stack([cos * n_y - sin * n_z, sin * n_y + cos * n_z])
    return normals, edges.offset[edge] + np.sum(normals * poses[placement, :2], axis=1)


def _on_a_stretch(
    placement: NDArray[np.intp], edge: NDArray[np.intp], along: Floats, near: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which points lie on an edge of which the points that are near cover a stretch that is long enough."""
    number = distinct_rows(np.column_stack([placement, edge])).number
    low = np.full(number.max(initial=-1) + 1, np.inf)
    high = -low
    np.minimum.at(low, number[near], along[near])
    np.maximum.at(high, number[near], along[near])
    return np.asarray((high - low >= SHORTEST_MM)[number])

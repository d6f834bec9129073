"""Cuts a closed mesh along a surface that is given by its signed distance at the vertices."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.virtual.optics.ranges import Ranges
from footscan.virtual.optics.scene import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

SPACING_MM = 0.3
"""Distance of points along a cut: about a pixel. Chosen by hand."""


class Cut(NamedTuple):
    """Points along the closed lines of a cut, in their order."""

    points: Floats
    """(N, 3) mm, frame of the mesh."""
    normals: Floats
    """(N, 3) unit, outward."""


class CutMesh:
    """A closed mesh that is ready to be cut many times."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        faces = mesh.faces
        pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        self._edges, number = np.unique(pairs, axis=0, return_inverse=True)
        self._edges_of_face = number.reshape(3, len(faces)).T
        order = np.argsort(number, kind="stable")
        if not np.array_equal(np.bincount(number), np.full(len(self._edges), 2)):
            raise ValueError("expected a closed mesh, with two faces at each edge")
        self._faces_of_edge = (order % len(faces)).reshape(-1, 2)
        corners = mesh.vertices[faces]
        crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = np.zeros_like(mesh.vertices)
        for corner in range(3):
            np.add.at(normals, faces[:, corner], crossed)
        self._normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        box = np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
        self.corners = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(8, 3)
        """Of the box around the mesh, mm."""
        self._ranges = Ranges(np.sort(mesh.vertices[self._edges, 0], axis=1))

    def edges_within(self, least: float, greatest: float) -> Ints:
        """The edges, (E,) in ascending order, that reach into a range of X, mm."""
        return np.sort(self._ranges.within(least, greatest))

    def ends(self, edges: Ints) -> Ints:
        """Both vertices of each of edges (E,), (2 E,)."""
        return self._edges[edges].ravel()

    def ends_near(self, distance: Floats, edges: Ints, mm: float) -> Ints:
        """Vertices, (K,), of those of `edges` (E,) that may be cut if `distance` changes by less than `mm`.

        distance : (V,) mm, at the vertices
        """
        return np.flatnonzero(_ends_near(self._edges[edges], distance, mm))

    def cut(self, distance: Floats, edges: Ints) -> Cut:
        """Cut where `distance`, (V,) mm at the vertices, is zero; `edges` (E,), ascending, are all that may be cut."""
        edges = edges[_crosses(self._edges[edges], distance)]
        if not len(edges):
            return Cut(np.empty((0, 3)), np.empty((0, 3)))
        faces = np.unique(self._faces_of_edge[edges])
        of_face = self._edges_of_face[faces]
        rows = np.minimum(np.searchsorted(edges, of_face), len(edges) - 1)
        rows[edges[rows] != of_face] = -1  # one of the three edges of a cut face is not cut
        ends = np.sort(rows, axis=1)[:, 1:]
        order, line = _trace(ends, np.searchsorted(faces, self._faces_of_edge[edges]))
        first, second = self._edges[edges[order]].T
        share = (distance[first] / (distance[first] - distance[second]))[:, None]
        points = self.mesh.vertices[first] * (1.0 - share) + self.mesh.vertices[second] * share
        normals = self._normals[first] * (1.0 - share) + self._normals[second] * share
        parts = [_resampled(points[line == k], normals[line == k]) for k in range(int(line.max()) + 1)]
        return Cut(*(np.concatenate([part[n] for part in parts]) for n in range(2)))


def _resampled(points: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """A closed line at even distances."""
    points, normals = np.vstack([points, points[:1]]), np.vstack([normals, normals[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.arange(SPACING_MM / 2.0, along[-1], SPACING_MM)
    even = np.column_stack([np.interp(at, along, column) for column in points.T])
    turned = np.column_stack([np.interp(at, along, column) for column in normals.T])
    return even, turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-30)


@compiled
def _ends_near(edges: Ints, distance: Floats, mm: float) -> Mask:
    """(V,) whether a vertex is the end of an edge that may be cut if `distance` (V,) changes by less than `mm`."""
    is_near = np.zeros(len(distance), np.bool_)
    for edge in range(len(edges)):
        first, second = distance[edges[edge, 0]], distance[edges[edge, 1]]
        if min(first, second) < mm and max(first, second) > -mm:
            is_near[edges[edge, 0]] = is_near[edges[edge, 1]] = True
    return is_near


@compiled
def _crosses(edges: Ints, distance: Floats) -> Mask:
    """(E,) whether `distance` (V,) changes its sign along an edge."""
    crosses = np.empty(len(edges), np.bool_)
    for edge in range(len(edges)):
        crosses[edge] = (distance[edges[edge, 0]] > 0.0) != (distance[edges[edge, 1]] > 0.0)
    return crosses


@compiled
def _trace(edges_of_face: Ints, faces_of_edge: Ints) -> tuple[Ints, Ints]:
    """Order cut edges along closed lines; returns the edges in order and the number of each one's line."""
    count = len(faces_of_edge)
    order, line, done = np.empty(count, np.int64), np.empty(count, np.int64), np.zeros(count, np.bool_)
    filled, lines = 0, 0
    for start in range(count):
        if done[start]:
            continue
        edge, face = start, faces_of_edge[start, 0]
        while not done[edge]:
            done[edge] = True
            order[filled], line[filled] = edge, lines
            filled += 1
            edge = edges_of_face[face, 1] if edges_of_face[face, 0] == edge else edges_of_face[face, 0]
            face = faces_of_edge[edge, 1] if faces_of_edge[edge, 0] == face else faces_of_edge[edge, 0]
        lines += 1
    return order, line

"""Distances of points from the faces of a body."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.calibration.travel.body import Body
from footscan.open3d_without_plots import o3d

Floats = NDArray[np.float64]

SHARP = np.cos(np.radians(20.0))
"""Cosine of the angle between two faces beyond which their edge is sharp. Chosen by hand."""
EDGE_MM = 3.0
"""The stripe is rounded so near to a sharp edge; points there are left out. Chosen by hand."""
SPACING_MM = 0.5
"""Distance of the places along an edge that stand for it."""
DIRECTIONS = 4.0
"""Normals are grouped by the cells of a grid with this many of them to the unit."""


class NearestFace:
    """The surface of a body, ready to be asked."""

    def __init__(self, body: Body) -> None:
        vertices, faces = np.asarray(body.vertices, np.float64), np.asarray(body.faces, np.int64)
        crossed = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
        self._normals = crossed / np.linalg.norm(crossed, axis=1, keepdims=True)
        self._corner = vertices[faces[:, 0]]
        self.middle: Floats = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            o3d.core.Tensor.from_numpy(vertices.astype(np.float32)),
            o3d.core.Tensor.from_numpy(faces.astype(np.uint32)),
        )
        along = _along_sharp_edges(vertices, faces, self._normals)
        self._edges = KDTree(along) if len(along) else None

    def distances(self, points: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Of points (N, 3) in the body's frame: how far each must go along the normal of its nearest face to lie on it,
        mm; that normal (N, 3); and whether it is away from sharp edges."""
        nearest = self._scene.compute_closest_points(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(points, np.float32))
        )
        face = nearest["primitive_ids"].numpy().astype(np.int64)
        normal = self._normals[face]
        distance = np.einsum("ij,ij->i", self._corner[face] - points, normal)
        if self._edges is None:
            return distance, normal, np.ones(len(points), np.bool_)
        to_edge = np.asarray(self._edges.query(nearest["points"].numpy(), distance_upper_bound=EDGE_MM)[0])
        return distance, normal, to_edge > EDGE_MM

    def group(self, normal: Floats) -> NDArray[np.int64]:
        """A number below 1000 for each normal (N, 3), the same for those in about the same direction."""
        cell = np.floor(DIRECTIONS * (normal + 1.0) + 0.5).astype(np.int64)
        return np.asarray(cell @ np.array([81, 9, 1]))


def _along_sharp_edges(vertices: Floats, faces: NDArray[np.int64], normals: Floats) -> Floats:
    """Places (N, 3) along the edges at which two faces meet sharply, or at which the mesh ends."""
    pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges, number = np.unique(pairs, axis=0, return_inverse=True)
    total = np.zeros((len(edges), 3))
    np.add.at(total, number.ravel(), np.tile(normals, (3, 1)))
    # Two unit normals at an angle a add up to 2 cos(a / 2).
    sharp = np.einsum("ij,ij->i", total, total) < 2.0 + 2.0 * SHARP
    parts = [np.empty((0, 3))]
    for a, b in vertices[edges[sharp]]:
        shares = np.linspace(0.0, 1.0, max(int(np.linalg.norm(b - a) / SPACING_MM) + 1, 2))[:, None]
        parts.append(a * (1.0 - shares) + b * shares)
    return np.concatenate(parts)

"""The nearest place of a mesh's or a cloud's surface, and whether the surface continues around it."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from footscan.mesh.formats.files import Shape
from footscan.mesh.topology import directed_edges, edge_counts

Floats = NDArray[np.float64]

PLANE_NEIGHBOURS = 12
"""Points to which the plane at a point of a cloud is fitted; chosen by hand."""
REACH_SPACINGS = 3.0
"""Distance from a point of a cloud, in spacings, within which its plane represents the surface; chosen by hand."""
TOUCHING_MM = 1e-3
"""At smaller distances from a mesh the direction to it is not defined, and the normal is taken."""
ON_BORDER = 1e-3
"""A place with a smaller barycentric coordinate lies on the edge of its triangle."""


@dataclass(frozen=True)
class Nearest:
    """The nearest places of a surface to N points."""

    places: Floats
    """(N, 3) mm, on the surface"""
    normals: Floats
    """(N, 3) unit vectors across the surface there, of either sign, along which the distance grows"""
    within: NDArray[np.bool_]
    """(N,) false where the surface ends at that place: at the rim of a hole or of a cloud, beyond which it is unknown
    (Turk & Levoy, "Zippered polygon meshes from range images", 1994)."""


class Surface(Protocol):
    """A surface with a search for nearest places."""

    def nearest(self, points: Floats) -> Nearest:
        """Find the places nearest to (N, 3) `points`, mm, in the frame of the surface."""


class MeshSurface:
    """The surface of a mesh: its triangles."""

    def __init__(self, mesh: Shape) -> None:
        from footscan.open3d_without_plots import o3d

        self._vertices, self._faces = np.asarray(mesh[0], np.float64), mesh[1]
        self._middle = (self._vertices.min(axis=0) + self._vertices.max(axis=0)) / 2  # the scene uses float32
        self._tensor = o3d.core.Tensor.from_numpy
        self._scene: Any = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            self._tensor((self._vertices - self._middle).astype(np.float32)),
            self._tensor(self._faces.astype(np.uint32)),
        )
        self._open_edge, self._open_vertex = _borders(self._faces, len(self._vertices))

    def nearest(self, points: Floats) -> Nearest:
        queries = (points - self._middle).astype(np.float32)
        answer = self._scene.compute_closest_points(self._tensor(queries))
        triangle = answer["primitive_ids"].numpy().astype(np.int64)
        u, v = answer["primitive_uvs"].numpy().astype(np.float64).T
        barycentric = np.column_stack([1 - u - v, u, v])
        corners = self._vertices[self._faces[triangle]]  # in float64: the place by the scene is off by up to 0.01 µm
        places = np.einsum("nk,nki->ni", barycentric, corners)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        offsets = points - places  # at edges and corners not along the normal of a triangle
        touching = np.linalg.norm(offsets, axis=1, keepdims=True) < TOUCHING_MM
        normals = np.where(touching, normals, offsets)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        at_edge = np.any(self._open_edge[triangle] & (barycentric < ON_BORDER), axis=1)
        at_vertex = np.any(self._open_vertex[self._faces[triangle]] & (barycentric > 1 - 2 * ON_BORDER), axis=1)
        return Nearest(places, normals, ~(at_edge | at_vertex))


def _borders(faces: NDArray[np.integer], vertices: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Returns (F, 3) whether the edge opposite to each corner is open, and (V,) whether a vertex is on an open edge."""
    edges, counts = edge_counts(faces)
    is_open = counts == 1
    keys = edges[:, 0] * vertices + edges[:, 1]
    own = np.sort(directed_edges(faces), axis=1)  # edges 01, 12, 20: opposite to the corners 2, 0, 1
    own_open = is_open[np.searchsorted(keys, own[:, 0] * vertices + own[:, 1])].reshape(3, -1)
    open_vertex = np.zeros(vertices, np.bool_)
    open_vertex[edges[is_open]] = True
    return own_open[[1, 2, 0]].T, open_vertex


class CloudSurface:
    """The surface of a cloud: at each point, the plane through its neighbours."""

    def __init__(self, points: Floats) -> None:
        """`points` : (N, 3) mm, evenly spread, at least `PLANE_NEIGHBOURS` of them."""
        self._tree = cKDTree(points)
        neighbours = np.asarray(self._tree.query(points, k=PLANE_NEIGHBOURS)[1])
        spacings = np.linalg.norm(points - points[neighbours[:, 1]], axis=1)
        self._reach = REACH_SPACINGS * float(np.median(spacings))
        near = points[neighbours]
        self._centres = near.mean(axis=1)
        offsets = near - self._centres[:, None]
        self._normals = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))[1][:, :, 0]

    def nearest(self, points: Floats) -> Nearest:
        _, index = self._tree.query(points)
        normals = self._normals[index]
        offsets = points - self._centres[index]
        height = np.einsum("ni,ni->n", offsets, normals)[:, None]
        beside = np.linalg.norm(offsets - height * normals, axis=1)
        within = beside <= self._reach
        places = np.where(within[:, None], points - height * normals, self._centres[index])
        return Nearest(places, normals, within)

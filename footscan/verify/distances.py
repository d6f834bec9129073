"""Distances of points to a mesh or to a cloud, block by block."""

from collections.abc import Callable
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.formats.files import Shape
from footscan.verify.pseudonormals import Sides, sides
from schemas.base.errors import RefusedInput

BLOCK = 100_000
"""Bound of memory: points per query."""
ON_MM = 1e-4
"""A place nearer than this to an edge or a vertex lies on it: queries in single precision are off by up to 0.00002
mm."""
FARTHEST_MM = 1e7
"""Largest coordinate that is accepted as mm; double precision resolves 0.000002 mm there."""

Floats = NDArray[np.floating]
Distances32 = NDArray[np.float32]


class Distances(NamedTuple):
    """Distances of N points, mm; single precision (10⁻⁷ of the value) keeps ten million in 40 MB."""

    unsigned: Distances32
    """(N,) distance to the nearest place"""
    signed: Distances32 | None
    """(N,) distance along the normal there, positive outside; None without normals. On a mesh it is as large as
    `unsigned`; on a cloud the part across the normal is left out, since it is mostly the spacing of the points."""

    @classmethod
    def of_signed(cls, signed: Distances32) -> Self:
        """Make both arrays from (N,) signed distances to a mesh."""
        return cls(np.abs(signed), signed)


def distances_to_mesh(points: Floats, mesh: Shape) -> Distances:
    """Compute the distance of each of (N, 3) `points`, mm, to the nearest place of `mesh`.

    Raises
    ------
    RefusedInput
        There are no points, no triangle has an area, or a coordinate is not finite.
    """
    return Distances.of_signed(signed_distances(points, mesh))


def signed_distances(points: Floats, mesh: Shape) -> Distances32:
    """Returns (N,) distances in mm of (N, 3) `points` to the nearest place of `mesh`, negative inside.

    The sign follows from the normal at the nearest place, see `footscan.verify.pseudonormals`. Errors as in
    `distances_to_mesh`.
    """
    return SearchedMesh(mesh).signed_distances(points)


class SearchedMesh:
    """A mesh with the search tree and the normals for distances to it; made once for many queries."""

    def __init__(self, mesh: Shape) -> None:
        """Errors are those of `distances_to_mesh` that concern the mesh."""
        from footscan.open3d_without_plots import o3d

        check_places(mesh[0], "reference")
        self._sides = sides(mesh)
        vertices, faces = self._sides.vertices, self._sides.faces
        if not len(faces):
            raise RefusedInput("reference", "has no triangle with an area, expected a mesh")
        # The scene uses single precision: 0.01 µm near its origin.
        self._centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        self._tensor = o3d.core.Tensor.from_numpy
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            self._tensor((vertices - self._centre).astype(np.float32)), self._tensor(faces.astype(np.uint32))
        )

    def signed_distances(self, points: Floats) -> Distances32:
        """Returns (N,) distances as the function `signed_distances` does."""
        check_places(points, "shape")
        signed = np.empty(len(points), np.float32)
        by_blocks(points, lambda block, out: self._fill(signed[out], block))
        return signed

    def _fill(self, signed: Distances32, block: NDArray[np.float64]) -> None:
        near = self._scene.compute_closest_points(self._tensor((block - self._centre).astype(np.float32)))
        face = near["primitive_ids"].numpy().astype(np.int64)
        u, v = near["primitive_uvs"].numpy().T.astype(np.float64)
        shares = np.stack([1 - u - v, u, v], axis=1)
        place = np.einsum("nk,nkx->nx", shares, self._sides.vertices[self._sides.faces[face]])
        offset = block - place
        inside = np.sum(offset * _normals_at(place, shares, face, self._sides), axis=1) < 0
        signed[:] = np.where(inside, -1, 1) * np.linalg.norm(offset, axis=1)


def distances_to_cloud(
    points: Floats, cloud: Floats, normals: Floats | None = None, point_normals: Floats | None = None
) -> Distances:
    """Compute the distance of each of (N, 3) `points` to the nearest of the (M, 3) points of `cloud`, mm.

    Parameters
    ----------
    normals : (M, 3) outward unit vectors of `cloud`, if known
    point_normals : (N, 3) outward unit vectors of `points`, used if the cloud has none

    Raises
    ------
    RefusedInput
        There are no points, all points of the cloud coincide, or a coordinate is not finite.

    Examples
    --------
    >>> up = np.array([[0.0, 0, 1], [0, 0, 1]])
    >>> apart = distances_to_cloud(np.array([[3.0, 4, 0], [0, 0, -2]]), np.array([[0.0, 0, 0], [9, 9, 9]]), up)
    >>> apart.unsigned.tolist(), apart.signed.tolist()
    ([5.0, 2.0], [0.0, -2.0])
    """
    from scipy.spatial import cKDTree

    check_places(points, "shape")
    check_places(cloud, "reference")
    if not np.any(np.ptp(cloud, axis=0)):
        raise RefusedInput("reference", "is a single point, expected a mesh or a cloud")
    tree = cKDTree(cloud, leafsize=32, balanced_tree=False)
    unsigned = np.empty(len(points), np.float32)
    signed = np.empty(len(points), np.float32)

    def of_block(block: NDArray[np.float64], out: slice) -> None:
        unsigned[out], nearest = tree.query(block, workers=-1)
        if normals is not None:
            signed[out] = np.sum((block - cloud[nearest]) * normals[nearest], axis=1)
        elif point_normals is not None:
            signed[out] = np.sum((block - cloud[nearest]) * point_normals[out], axis=1)

    by_blocks(points, of_block)
    return Distances(unsigned, None if normals is None and point_normals is None else signed)


def check_places(coordinates: Floats, name: str) -> None:
    """Refuse coordinates, (N, 3), that cannot be those of a shape in mm; the message names the shape `name`.

    Raises
    ------
    RefusedInput
        There are none, or one is not finite or larger than `FARTHEST_MM`.
    """
    if not len(coordinates):
        raise RefusedInput(name, "is empty, expected a mesh or a cloud")
    # The extremes are NaN if any coordinate is, and need no further array.
    farthest = np.max(np.abs([coordinates.min(axis=0), coordinates.max(axis=0)]))
    if not farthest <= FARTHEST_MM:
        problem = "coordinates that are no numbers" if np.isnan(farthest) else f"a coordinate of {farthest:.3g}"
        raise RefusedInput(name, f"holds {problem}, expected mm, at most {FARTHEST_MM:g}")


def by_blocks(points: Floats, of_block: Callable[[NDArray[np.float64], slice], None]) -> None:
    """Call `of_block` with each block of (N, 3) `points` and its slice of rows."""
    for start in range(0, len(points), BLOCK):
        block = slice(start, start + BLOCK)
        of_block(np.asarray(points[block], np.float64), block)


def _normals_at(
    place: NDArray[np.float64], shares: NDArray[np.float64], face: NDArray[np.int64], mesh: Sides
) -> NDArray[np.float64]:
    """Returns (N, 3) normals at places on a mesh: of the vertex or the edge on which a place lies, or of its face.

    Parameters
    ----------
    place : (N, 3) mm
    shares : (N, 3) barycentric coordinates of the places, which give their distances from the edges
    face : (N,) faces of the places
    """
    normals = mesh.of_faces[face]
    from_edges = shares * mesh.heights[face]
    edge = np.argmin(from_edges, axis=1)
    on_edge = np.flatnonzero(from_edges[np.arange(len(face)), edge] < ON_MM)  # including places on a corner
    place, face, edge = place[on_edge], face[on_edge], edge[on_edge]
    normals[on_edge] = mesh.of_edges[face, edge]

    from_corners = np.linalg.norm(mesh.vertices[mesh.faces[face]] - place[:, None], axis=2)
    corner = np.argmin(from_corners, axis=1)
    on_corner = from_corners[np.arange(len(face)), corner] < ON_MM
    normals[on_edge[on_corner]] = mesh.of_vertices[mesh.faces[face[on_corner], corner[on_corner]]]
    return normals

"""Distances of points to a mesh or to a cloud, block by block."""

from collections.abc import Callable
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.formats.files import Shape
from footscan.verify.pseudonormals import Sides, sides
from schemas.base.errors import RefusedInput

BLOCK = 100_000
"""Points a query; it bounds the memory."""
ON_MM = 1e-4
"""A place of a mesh that lies closer than this to an edge or a vertex lies on it: its query was made in single
precision, which moves it by up to 0.00002 mm."""
FARTHEST_MM = 1e7
"""What lies farther from the origin is not in mm; in double precision it would be known to 0.000002 mm."""

Floats = NDArray[np.floating]
Distances32 = NDArray[np.float32]


class Distances(NamedTuple):
    """Of N points, in mm; single precision (to 10⁻⁷ of them) keeps ten million in 40 MB."""

    unsigned: Distances32
    """(N,) to the nearest place."""
    signed: Distances32 | None
    """(N,) along the normal there, positive outside; None where no normal is known. As large as `unsigned` on a mesh;
    on a cloud what lies across the normal is left out, as it is for the most part the spacing of the points."""

    @classmethod
    def of_signed(cls, signed: Distances32) -> Self:
        """Of (N,) distances to a mesh."""
        return cls(np.abs(signed), signed)


def distances_to_mesh(points: Floats, mesh: Shape) -> Distances:
    """Of each of (N, 3) `points` to the nearest place of `mesh`.

    Raises
    ------
    RefusedInput
        There are no points, no triangle has an area, or a coordinate is not finite.
    """
    return Distances.of_signed(signed_distances(points, mesh))


def signed_distances(points: Floats, mesh: Shape) -> Distances32:
    """(N,) distance in mm of each of (N, 3) `points` to the nearest place of `mesh`, negative inside.

    What is inside is told by the normal at the nearest place, see `footscan.verify.pseudonormals`. Errors as in
    `distances_to_mesh`.
    """
    return SearchedMesh(mesh).signed_distances(points)


class SearchedMesh:
    """A mesh with the search tree and the normals that distances to it take: made once, asked often."""

    def __init__(self, mesh: Shape) -> None:
        """Errors are those of `distances_to_mesh` that concern the mesh."""
        import open3d as o3d

        check_places(mesh[0], "reference")
        self._sides = sides(mesh)
        vertices, faces = self._sides.vertices, self._sides.faces
        if not len(faces):
            raise RefusedInput("reference", "has no triangle with an area, expected a mesh")
        # The scene counts in single precision: 0.01 um near its origin.
        self._centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        self._tensor = o3d.core.Tensor.from_numpy
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            self._tensor((vertices - self._centre).astype(np.float32)), self._tensor(faces.astype(np.uint32))
        )

    def signed_distances(self, points: Floats) -> Distances32:
        """As the function of that name."""
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
    """Of each of (N, 3) `points` to the nearest of the (M, 3) points of `cloud`.

    Parameters
    ----------
    normals : (M, 3) outward unit vectors of `cloud`, where they are known
    point_normals : (N, 3) those of `points`, which serve where the cloud has none

    Raises
    ------
    RefusedInput
        There are no points, the cloud is a single place, or a coordinate is not finite.
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
    """Refuses coordinates, (N, 3) mm, that are none of a shape; `name` is what the refusal calls it.

    Raises
    ------
    RefusedInput
        There are none, or one is not finite or not in mm.
    """
    if not len(coordinates):
        raise RefusedInput(name, "is empty, expected a mesh or a cloud")
    # Extremes tell of NaN, too, and need no array of answers.
    farthest = np.max(np.abs([coordinates.min(axis=0), coordinates.max(axis=0)]))
    if not farthest <= FARTHEST_MM:
        problem = "coordinates that are no numbers" if np.isnan(farthest) else f"a coordinate of {farthest:.3g}"
        raise RefusedInput(name, f"holds {problem}, expected mm, at most {FARTHEST_MM:g}")


def by_blocks(points: Floats, of_block: Callable[[NDArray[np.float64], slice], None]) -> None:
    """Calls `of_block` with each block of (N, 3) `points` and the rows that it comes from."""
    for start in range(0, len(points), BLOCK):
        block = slice(start, start + BLOCK)
        of_block(np.asarray(points[block], np.float64), block)


def _normals_at(
    place: NDArray[np.float64], shares: NDArray[np.float64], face: NDArray[np.int64], mesh: Sides
) -> NDArray[np.float64]:
    """(N, 3) normals at (N, 3) places on the faces `face`: of the vertex or the edge that a place lies on, or of the
    face. `shares` (N, 3) of the corners in the places tell how far each is from the edge opposite to a corner."""
    normals = mesh.of_faces[face]
    from_edges = shares * mesh.heights[face]
    edge = np.argmin(from_edges, axis=1)
    on_edge = np.flatnonzero(from_edges[np.arange(len(face)), edge] < ON_MM)  # and so is what lies on a corner
    place, face, edge = place[on_edge], face[on_edge], edge[on_edge]
    normals[on_edge] = mesh.of_edges[face, edge]

    from_corners = np.linalg.norm(mesh.vertices[mesh.faces[face]] - place[:, None], axis=2)
    corner = np.argmin(from_corners, axis=1)
    on_corner = from_corners[np.arange(len(face)), corner] < ON_MM
    normals[on_edge[on_corner]] = mesh.of_vertices[mesh.faces[face[on_corner], corner[on_corner]]]
    return normals

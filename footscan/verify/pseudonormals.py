"""Normals of a mesh's faces, edges and vertices, which decide whether a point lies outside or inside."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.formats.files import Shape
from footscan.mesh.topology import face_components
from footscan.rows import distinct_rows

SOLID_SHARE = 0.02
"""Least volume over area^1.5 of a body with an inside; a ball has 0.094, a foot 0.05, a sheet 0. Chosen by hand."""

Floats = NDArray[np.float64]


class Sides(NamedTuple):
    """A mesh with the pseudonormals of its faces, edges and vertices.

    A point p whose closest place on the mesh is q lies outside if (p - q) · n > 0, where n is the normal of the face,
    edge or vertex on which q lies: Baerentzen and Aanaes, "Signed distance computation using the angle weighted
    pseudonormal", IEEE TVCG 11(3), 2005, doi:10.1109/TVCG.2005.49.

    Unlike counting the crossings of a ray, this works on a mesh with holes: there it gives the side of the rim on
    which the point lies.
    """

    vertices: Floats
    """(V, 3) mm, no two at one place"""
    faces: NDArray[np.int32]
    """(F, 3), each with an area and no two alike, counter-clockwise seen from outside"""
    of_faces: Floats
    """(F, 3) unit normals"""
    of_edges: Floats
    """(F, 3, 3) sums of the unit normals that meet at the edge opposite to each corner"""
    of_vertices: Floats
    """(V, 3) sums of the unit normals that meet at each vertex, weighted by the angles there"""
    heights: Floats
    """(F, 3) mm, height of each corner above the edge opposite to it"""


def sides(mesh: Shape) -> Sides:
    """Compute the pseudonormals of `mesh`; F = 0 if no face has an area.

    Faces may be turned any way, repeated or without area. Faces that share an edge are turned alike. A body is turned
    so that its faces look outward; a sheet stays as it is, since its outer side is unknown.
    """
    vertices, faces = _merged(*mesh)
    edge_of, along, meeting = _edges(faces)
    if _contradicts(edge_of, along, meeting):
        faces = _turned_alike(vertices, faces)
        for part in _parts(faces):
            faces[part] = _outward(vertices, faces[part])
    else:
        faces = _outward(vertices, faces)
    edge_of, _, _ = _edges(faces)  # turning a face has exchanged two of its corners
    corners = vertices.take(faces, axis=0)
    normals = _unit(_area_vectors(corners))
    of_edges = _sums(edge_of.ravel(), np.repeat(normals, 3, axis=0), len(meeting))
    weighted = (normals[:, None] * _angles(corners)[..., None]).reshape(-1, 3)
    of_vertices = _sums(faces.ravel(), weighted, len(vertices))
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1), axis=2)
    heights = 2 * np.linalg.norm(_area_vectors(corners), axis=1)[:, None] / edges
    return Sides(vertices, faces, normals, of_edges[edge_of], of_vertices, heights)


def _merged(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> tuple[Floats, NDArray[np.int32]]:
    """Merge vertices at one place; drop faces without area and repeated faces."""
    places, _, of_vertex, _ = distinct_rows(np.asarray(vertices, np.float64) + 0.0)
    merged = of_vertex[faces]
    area = np.linalg.norm(_area_vectors(places.take(merged, axis=0)), axis=1)
    merged = merged[area > 0]
    first = np.sort(distinct_rows(np.sort(merged, axis=1)).first)
    return places, merged[first].astype(np.int32)


def _edges(faces: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int8], NDArray[np.int64]]:
    """Returns (F, 3) the edge opposite to each corner, (F, 3) 1 or -1 as the face runs along it, (E,) faces there."""
    start, end = faces[:, [1, 2, 0]].astype(np.int64), faces[:, [2, 0, 1]].astype(np.int64)
    size = int(faces.max(initial=0)) + 1
    key = np.minimum(start, end) * size + np.maximum(start, end)
    _, edge_of, meeting = np.unique(key.ravel(), return_inverse=True, return_counts=True)
    return edge_of.reshape(-1, 3), np.where(start < end, 1, -1).astype(np.int8), meeting


def _contradicts(edge_of: NDArray[np.int64], along: NDArray[np.int8], meeting: NDArray[np.int64]) -> bool:
    """True if the two faces of an edge run along it in the same direction."""
    direction = np.bincount(edge_of.ravel(), weights=along.ravel(), minlength=len(meeting))
    return bool(np.any((meeting == 2) & (direction != 0)))


def _turned_alike(vertices: Floats, faces: NDArray[np.int32]) -> NDArray[np.int32]:
    from footscan.open3d_without_plots import o3d

    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(faces))
    mesh.orient_triangles()  # as far as possible: a Möbius strip has one side
    return np.asarray(mesh.triangles).astype(np.int32)


def _parts(faces: NDArray[np.int32]) -> list[NDArray[np.int64]]:
    """Returns the rows of the faces of each part of a mesh."""
    part = face_components(faces)
    order = np.argsort(part, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(part[order])) + 1)


def _outward(vertices: Floats, faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Turn `faces` over if they enclose a negative volume.

    The volume is computed from the middle of the rim, from where a hole contributes next to nothing, so that the
    divergence theorem holds for open meshes.
    """
    if not len(faces):
        return faces
    edge_of, _, meeting = _edges(faces)
    rim = faces[:, [1, 2, 0]][meeting[edge_of] == 1]
    corners = vertices[faces] - (vertices[rim] if len(rim) else vertices[faces[:, 0]]).mean(axis=0)
    area_vectors = _area_vectors(corners)
    volume = float(np.sum(corners[:, 0] * area_vectors)) / 3
    area = float(np.linalg.norm(area_vectors, axis=1).sum())
    return faces[:, ::-1] if volume < -SOLID_SHARE * area**1.5 else faces


def _area_vectors(corners: Floats) -> Floats:
    """Returns (F, 3) normals whose lengths are the areas of the triangles."""
    vectors: Floats = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    return vectors


def _angles(corners: Floats) -> Floats:
    """Returns (F, 3) the angle of each triangle at each corner, radians."""
    angles = np.empty(corners.shape[:2])
    for k in range(3):
        a, b = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        angles[:, k] = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1))
    return angles


def _unit(vectors: Floats) -> Floats:
    unit: Floats = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit


def _sums(group: NDArray[np.integer], vectors: Floats, count: int) -> Floats:
    """Returns (count, 3) sums of (N, 3) `vectors` by their `group`."""
    return np.column_stack([np.bincount(group, weights=vectors[:, axis], minlength=count) for axis in range(3)])

"""Meshes and clouds with properties of their vertices."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

METADATA_KEYS = ("patient", "scan", "side", "frame", "unit", "software")
"""Keys of metadata that are read back from files."""

VERTEX_ARRAYS = ("normals", "colours", "camera", "filled")


@dataclass(frozen=True)
class Mesh:
    """Triangles in mm, or a cloud if there are no faces. None marks a property that is unknown."""

    vertices: NDArray[np.float64]
    """(V, 3) mm"""
    faces: NDArray[np.int32]
    """(F, 3), counter-clockwise as seen from outside"""
    normals: NDArray[np.float64] | None = None
    """(V, 3) unit vectors, outward"""
    colours: NDArray[np.uint8] | None = None
    """(V, 3) red, green and blue, sRGB"""
    camera: NDArray[np.uint8] | None = None
    """(V,) camera of origin; 0 where the surface was filled"""
    filled: NDArray[np.bool_] | None = None
    """(V,) true where the surface was filled, not measured"""
    metadata: Mapping[str, str] = field(default_factory=dict)
    """Patient, scan, side, software and others; a key is one word"""

    def __post_init__(self) -> None:
        for name in VERTEX_ARRAYS:
            values = getattr(self, name)
            if values is not None and len(values) != len(self.vertices):
                raise ValueError(f"{name} of {len(values)} vertices, expected {len(self.vertices)}")
        for key in self.metadata:
            if not (key.isascii() and key.isidentifier()):
                raise ValueError(f"metadata {key!r}, expected a key of one word")


def used(mesh: Mesh) -> Mesh:
    """Drop the vertices that have no triangle."""
    kept, faces = np.unique(mesh.faces, return_inverse=True)
    arrays = {name: getattr(mesh, name) for name in VERTEX_ARRAYS}
    kept_arrays = {name: values[kept] for name, values in arrays.items() if values is not None}
    return replace(mesh, vertices=mesh.vertices[kept], faces=faces.reshape(-1, 3).astype(np.int32), **kept_arrays)


def signed_volume(mesh: Mesh) -> float:
    """Volume of a closed mesh in mm³, negative if its faces look inwards; for an open mesh, about what it encloses.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32)
    >>> round(signed_volume(Mesh(corners, faces)), 6)
    0.166667
    """
    corners = (mesh.vertices - mesh.vertices.mean(axis=0))[mesh.faces]
    return float(np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6)


def outward(mesh: Mesh) -> Mesh:
    """Turn faces and normals over if the faces look inwards."""
    if signed_volume(mesh) >= 0:
        return mesh
    normals = None if mesh.normals is None else -mesh.normals
    return replace(mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1]), normals=normals)


def on_floor(mesh: Mesh) -> Mesh:
    """Move the mesh along Z until its lowest vertex is at Z = 0."""
    return replace(mesh, vertices=mesh.vertices - [0.0, 0.0, mesh.vertices[:, 2].min()])


def with_normals(mesh: Mesh) -> Mesh:
    """Add normals of the vertices if there are none: means of the faces around each vertex, weighted by their angles.

    G. Thürmer and C. A. Wüthrich, "Computing vertex normals from polygonal facets", 1998.
    """
    if mesh.normals is not None:
        return mesh
    corners = mesh.vertices.take(mesh.faces, axis=0)  # eight times as fast as in brackets
    normals = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    angles = []
    for corner in range(3):
        back = _unit(corners[:, corner - 1] - corners[:, corner])
        ahead = _unit(corners[:, corner - 2] - corners[:, corner])
        angles.append(np.arccos(np.clip(np.sum(back * ahead, axis=1), -1.0, 1.0)))
    vertex, weight = mesh.faces.T.ravel(), np.concatenate(angles)
    sums = [np.bincount(vertex, weight * np.tile(along, 3), len(mesh.vertices)) for along in normals.T]
    return replace(mesh, normals=_unit(np.column_stack(sums)))


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns (N, 3) vectors of length 1; zero vectors stay zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: NDArray[np.float64] = np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)
    return unit

"""A mesh with what is known of each vertex."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

KNOWN_OF_A_MESH = ("patient", "scan", "side", "frame", "unit", "software")
"""Keys of metadata that files bear and that are read back."""

OF_VERTICES = ("normals", "colours", "camera", "filled")


@dataclass(frozen=True)
class Mesh:
    """Triangles in mm; without faces it is a cloud. What is None is not known."""

    vertices: NDArray[np.float64]
    """(V, 3) mm"""
    faces: NDArray[np.int32]
    """(F, 3), counter-clockwise as seen from outside"""
    normals: NDArray[np.float64] | None = None
    """(V, 3) unit vectors, outward"""
    colours: NDArray[np.uint8] | None = None
    """(V, 3) red, green and blue as a picture has them (sRGB)"""
    camera: NDArray[np.uint8] | None = None
    """(V,) camera of origin; 0 where the surface was filled"""
    filled: NDArray[np.bool_] | None = None
    """(V,) whether the surface was filled here, not measured"""
    metadata: Mapping[str, str] = field(default_factory=dict)
    """Such as patient, scan, side and software; a key is one word."""

    def __post_init__(self) -> None:
        for name in OF_VERTICES:
            values = getattr(self, name)
            if values is not None and len(values) != len(self.vertices):
                raise ValueError(f"{name} of {len(values)} vertices, expected {len(self.vertices)}")
        for key in self.metadata:
            if not (key.isascii() and key.isidentifier()):
                raise ValueError(f"metadata {key!r}, expected a key of one word")


def used(mesh: Mesh) -> Mesh:
    """The mesh without vertices that have no triangle."""
    kept, faces = np.unique(mesh.faces, return_inverse=True)
    of_vertices = {name: getattr(mesh, name) for name in OF_VERTICES}
    known = {name: values[kept] for name, values in of_vertices.items() if values is not None}
    return replace(mesh, vertices=mesh.vertices[kept], faces=faces.reshape(-1, 3).astype(np.int32), **known)


def signed_volume(mesh: Mesh) -> float:
    """Volume in mm³ of a closed mesh, below 0 where its faces look inwards; of an open one about what it encloses."""
    corners = (mesh.vertices - mesh.vertices.mean(axis=0))[mesh.faces]
    return float(np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6)


def outward(mesh: Mesh) -> Mesh:
    """The mesh, its faces and normals turned over together where they look inwards."""
    if signed_volume(mesh) >= 0:
        return mesh
    normals = None if mesh.normals is None else -mesh.normals
    return replace(mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1]), normals=normals)


def on_floor(mesh: Mesh) -> Mesh:
    """The mesh, lifted or lowered until its lowest vertex stands at Z = 0."""
    return replace(mesh, vertices=mesh.vertices - [0.0, 0.0, mesh.vertices[:, 2].min()])


def with_normals(mesh: Mesh) -> Mesh:
    """The mesh, with those of its vertices where it has none: the mean of the faces around each, by their angles.

    G. Thürmer and C. A. Wüthrich, "Computing vertex normals from polygonal facets", 1998.
    """
    if mesh.normals is not None:
        return mesh
    corners = mesh.vertices[mesh.faces]
    normals = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    sums = np.zeros_like(mesh.vertices)
    for corner in range(3):
        back = _unit(corners[:, corner - 1] - corners[:, corner])
        ahead = _unit(corners[:, corner - 2] - corners[:, corner])
        angle = np.arccos(np.clip(np.sum(back * ahead, axis=1), -1.0, 1.0))
        np.add.at(sums, mesh.faces[:, corner], angle[:, None] * normals)
    return replace(mesh, normals=_unit(sums))


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) the vectors with length 1; those of length 0 stay."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: NDArray[np.float64] = np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)
    return unit

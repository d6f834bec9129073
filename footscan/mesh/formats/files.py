"""Reading and writing of meshes and clouds, by file suffix. Lengths are in mm, except in GLB (m)."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.formats.glb import glb_of
from footscan.mesh.formats.obj import obj_of, parse_obj
from footscan.mesh.formats.ply import parse_ply, ply_of
from footscan.mesh.formats.stl import parse_stl, stl_of
from footscan.mesh.formats.threemf import threemf_of
from footscan.mesh.formats.vrml import vrml_of
from footscan.mesh.mesh import Mesh
from schemas.base.errors import RefusedInput
from schemas.base.limits import BeyondLimitError, read_bounded

Shape = tuple[NDArray[np.float64], NDArray[np.int32]]
"""(V, 3) vertices in mm and (F, 3) faces; a cloud is a shape without faces."""

FARTHEST_MM = 1e9
"""Largest coordinate that is accepted; a mesh in micrometres stays below, and powers of coordinates stay finite."""
PARSERS = {".stl": parse_stl, ".ply": parse_ply, ".obj": parse_obj}
WRITERS: dict[str, Callable[[Mesh], bytes]] = {
    ".stl": stl_of,
    ".ply": ply_of,
    ".obj": obj_of,
    ".wrl": vrml_of,
    ".3mf": threemf_of,
    ".glb": glb_of,
}


def mesh_bytes(mesh: Mesh, suffix: str) -> bytes:
    """Encode a mesh in the format of `suffix`, one of `WRITERS`.

    The same mesh gives the same bytes. Properties that the format cannot hold are left out.
    """
    return WRITERS[suffix](mesh)


def read_file(path: Path) -> Mesh:
    """Read a mesh or a cloud from an STL, PLY or OBJ file.

    Vertices that STL repeats for every triangle are merged, and polygons are cut into triangles.

    Raises
    ------
    RefusedInput
        The file is missing, broken, of another kind, or holds no point.
    """
    parser = PARSERS.get(path.suffix.lower())
    if parser is None:
        raise RefusedInput(path, f"expected a file that ends in {', '.join(PARSERS)}, found {path.suffix!r}")
    try:
        content = read_bounded(path, "mesh_bytes")
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        raise RefusedInput(path, "no such file" if missing else f"cannot be read ({error.strerror})") from None
    try:
        mesh = parser(content)
    except BeyondLimitError as error:  # the parser does not know the path
        raise BeyondLimitError(path, error.problem) from None
    except ValueError as error:
        raise RefusedInput(path, f"is no proper {path.suffix.lower()[1:].upper()} file: {error}") from None
    if not len(mesh.vertices):
        raise RefusedInput(path, "holds no points, expected a mesh or a cloud")
    if not np.all(np.isfinite(mesh.vertices)):
        raise RefusedInput(path, "holds coordinates that are no numbers, expected mm")
    if np.abs(mesh.vertices).max() > FARTHEST_MM:
        raise RefusedInput(path, f"holds coordinates beyond {FARTHEST_MM:.0f}, expected mm")
    if mesh.metadata.get("unit", "mm") != "mm":
        raise RefusedInput(path, f"is in {mesh.metadata['unit']!r}, expected mm", field="unit")
    if mesh.faces.size and not 0 <= int(mesh.faces.min()) <= int(mesh.faces.max()) < len(mesh.vertices):
        problem = f"has faces of vertices that do not exist, expected numbers below {len(mesh.vertices)}"
        raise RefusedInput(path, problem)
    a, b, c = mesh.faces.T
    return replace(mesh, faces=mesh.faces[(a != b) & (b != c) & (c != a)])


def read_shape(path: Path) -> Shape:
    """Read the vertices and faces of a file; errors as in `read_file`."""
    mesh = read_file(path)
    return mesh.vertices, mesh.faces


def read_mesh(path: Path) -> Shape:
    """Read the vertices and faces of a mesh; errors as in `read_file`, and for a file without faces."""
    vertices, faces = read_shape(path)
    if not len(faces):
        raise RefusedInput(path, "holds no triangles, expected a mesh")
    return vertices, faces


def read_points(path: Path) -> NDArray[np.float64]:
    """Read (N, 3) the points of a cloud or the vertices of a mesh, mm; errors as in `read_file`."""
    return read_shape(path)[0]

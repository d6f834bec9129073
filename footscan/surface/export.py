"""Files of meshes and clouds, written and read. Lengths are mm; files that say otherwise are refused by their size."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.surface.parsers import STL_TRIANGLE, parse_obj, parse_ply, parse_stl
from schemas.errors import RefusedInput

Shape = tuple[NDArray[np.float64], NDArray[np.int32]]
"""(V, 3) vertices in mm and (F, 3) faces; a cloud is a shape without faces."""

MAX_BYTES = 2**30
PARSERS = {".stl": parse_stl, ".ply": parse_ply, ".obj": parse_obj}
CLOUD_VERTEX = np.dtype([(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")] + [("camera", "u1")])


def stl_bytes(vertices: NDArray[np.floating], faces: NDArray[np.integer], header: str) -> bytes:
    """A binary STL file.

    Parameters
    ----------
    vertices : (V, 3) mm
    faces : (F, 3)
    header : at most 80 ASCII characters, such as "footscan unit=mm side=right"; must not begin with "solid",
        by which readers know an STL file of text
    """
    encoded = header.encode("ascii", "replace")
    if encoded.lower().startswith(b"solid") or len(encoded) > 80:
        raise ValueError(f"STL header {header!r}, expected at most 80 characters that do not begin with 'solid'")
    corners = np.asarray(vertices, np.float64)[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    triangles = np.zeros(len(faces), STL_TRIANGLE)
    triangles["normal"] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    triangles["corners"] = corners
    return encoded.ljust(80, b"\0") + len(faces).to_bytes(4, "little") + triangles.tobytes()


def cloud_ply_bytes(
    points: NDArray[np.floating],
    normals: NDArray[np.floating],
    camera: NDArray[np.integer],
    comments: tuple[str, ...] = ("unit mm",),
) -> bytes:
    """A binary little-endian PLY file of a cloud.

    Parameters
    ----------
    points : (N, 3) mm
    normals : (N, 3) unit vectors
    camera : (N,) camera of origin
    comments : lines of the header
    """
    vertex = np.zeros(len(points), CLOUD_VERTEX)
    vertex["x"], vertex["y"], vertex["z"] = np.asarray(points).T
    vertex["nx"], vertex["ny"], vertex["nz"] = np.asarray(normals).T
    vertex["camera"] = camera
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {' '.join(comment.split())}" for comment in comments),
        f"element vertex {len(points)}",
        *(f"property float {name}" for name in CLOUD_VERTEX.names or () if name != "camera"),
        "property uchar camera",
        "end_header",
    ]
    return "\n".join(lines).encode("ascii", "replace") + b"\n" + vertex.tobytes()


def read_shape(path: Path) -> Shape:
    """Vertices and faces of an STL, PLY or OBJ file; a PLY or OBJ file without faces is a cloud.

    Vertices that STL repeats for every triangle are merged; polygons are cut into triangles.

    Raises
    ------
    RefusedInput
        The file is missing, broken, of another kind, or holds no point.
    """
    parser = PARSERS.get(path.suffix.lower())
    if parser is None:
        raise RefusedInput(path, f"expected a file that ends in {', '.join(PARSERS)}, found {path.suffix!r}")
    try:
        if path.stat().st_size > MAX_BYTES:
            raise RefusedInput(path, f"larger than {MAX_BYTES} bytes, expected a mesh or cloud of a foot")
        content = path.read_bytes()
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        raise RefusedInput(path, "no such file" if missing else f"cannot be read ({error.strerror})") from None
    try:
        vertices, faces = parser(content)
    except ValueError as error:
        raise RefusedInput(path, f"is no proper {path.suffix.lower()[1:].upper()} file: {error}") from None
    if not len(vertices):
        raise RefusedInput(path, "holds no points, expected a mesh or a cloud")
    if not np.all(np.isfinite(vertices)):
        raise RefusedInput(path, "holds coordinates that are no numbers, expected mm")
    if faces.size and not 0 <= int(faces.min()) <= int(faces.max()) < len(vertices):
        raise RefusedInput(path, f"has faces of vertices that are not there, expected numbers below {len(vertices)}")
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return vertices, faces[distinct].astype(np.int32)


def read_mesh(path: Path) -> Shape:
    """As `read_shape`, and refuses what has no faces."""
    vertices, faces = read_shape(path)
    if not len(faces):
        raise RefusedInput(path, "holds no triangles, expected a mesh")
    return vertices, faces


def read_points(path: Path) -> NDArray[np.float64]:
    """(N, 3) the points of a cloud, or the vertices of a mesh, mm; errors as in `read_shape`."""
    return read_shape(path)[0]

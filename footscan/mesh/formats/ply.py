"""PLY files, with all properties of the vertices; written as binary, read as binary or text."""

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.formats.ply_rows import Rows, ply_rows
from footscan.mesh.formats.polygons import Polygons, fans, vertex_numbers
from footscan.mesh.formats.text import metadata_lines
from footscan.mesh.mesh import Mesh

FACE = np.dtype([("corners", "u1"), ("vertex_indices", "<i4", 3)])
PLACE, NORMAL, COLOUR = ("x", "y", "z"), ("nx", "ny", "nz"), ("red", "green", "blue")


def ply_of(mesh: Mesh) -> bytes:
    """Encode a binary little-endian PLY file with normals, colours, camera of origin and filled, if known.

    Without faces the file is that of a cloud.
    """
    columns = dict(zip(PLACE, mesh.vertices.astype("<f4").T, strict=True))
    if mesh.normals is not None:
        columns |= dict(zip(NORMAL, mesh.normals.astype("<f4").T, strict=True))
    if mesh.colours is not None:
        columns |= dict(zip(COLOUR, mesh.colours.astype("u1").T, strict=True))
    columns |= {
        name: values.astype("u1")
        for name, values in (("camera", mesh.camera), ("filled", mesh.filled))
        if values is not None
    }
    vertex = np.zeros(len(mesh.vertices), [(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        vertex[name] = column
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {line}" for line in metadata_lines(mesh.metadata)),
        f"element vertex {len(vertex)}",
        *(f"property {'float' if column.dtype.kind == 'f' else 'uchar'} {name}" for name, column in columns.items()),
    ]
    face = np.zeros(len(mesh.faces), FACE)
    if len(face):
        face["corners"], face["vertex_indices"] = 3, mesh.faces
        lines += [f"element face {len(face)}", "property list uchar int vertex_indices"]
    header = "\n".join([*lines, "end_header", ""]).encode("ascii", "replace")
    return header + vertex.tobytes() + face.tobytes()


def parse_ply(content: bytes) -> Mesh:
    """Read a mesh or a cloud from a PLY file; raises ValueError if it breaks the format."""
    header, elements = ply_rows(content)
    vertex = {name: column for name, column in elements.get("vertex", {}).items() if isinstance(column, np.ndarray)}
    if "vertex" in elements and not vertex.keys() >= set(PLACE):
        raise ValueError(f"vertices without {', '.join(sorted(set(PLACE) - vertex.keys()))}")
    places, normals, colours = (_columns(vertex, names) for names in (PLACE, NORMAL, COLOUR))
    camera, filled = _columns(vertex, ("camera",)), _columns(vertex, ("filled",))
    return Mesh(
        np.zeros((0, 3)) if places is None else places,
        _faces(elements["face"]) if "face" in elements else np.zeros((0, 3), np.int32),
        normals=normals if normals is not None and np.isfinite(normals).all() else None,
        colours=None if colours is None else _colours(colours),
        camera=None if camera is None else _levels(camera[:, 0]),
        filled=None if filled is None else filled[:, 0] > 0,
        metadata=header.metadata,
    )


def _columns(vertex: dict[str, NDArray[np.generic]], names: tuple[str, ...]) -> NDArray[np.float64] | None:
    """Returns (V, K) the properties of these names; None if one is missing."""
    if not vertex.keys() >= set(names):
        return None
    return np.column_stack([np.asarray(vertex[name], np.float64) for name in names])


def _colours(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Returns levels 0 to 255; values that are all at most 1 are shares of 255."""
    return _levels(values * 255 if np.nan_to_num(values).max(initial=0) <= 1 else values)


def _levels(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(np.clip(np.nan_to_num(values), 0, 255)).astype(np.uint8)


def _faces(face: Rows) -> NDArray[np.int32]:
    polygons = face.get("vertex_indices", face.get("vertex_index"))
    if polygons is None:
        raise ValueError("faces without vertex_indices")
    return fans(polygons) if isinstance(polygons, Polygons) else vertex_numbers(polygons)

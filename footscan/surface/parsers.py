"""STL, PLY and OBJ as bytes to vertices and faces. What breaks a format raises a ValueError that says how.

Files come from outside: every count in one is held against the bytes that are there before anything is allocated.
"""

import numpy as np
from numpy.typing import NDArray

VerticesAndFaces = tuple[NDArray[np.float64], NDArray[np.int64]]

STL_START = 84
STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
PLY_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
PLY_BYTE_ORDER = {"binary_little_endian": "<", "binary_big_endian": ">"}
PLY_MAX_HEADER = 2**16


def parse_stl(content: bytes) -> VerticesAndFaces:
    """Binary or text STL; equal vertices are merged."""
    count = int.from_bytes(content[80:STL_START], "little") if len(content) >= STL_START else -1
    if len(content) == STL_START + count * STL_TRIANGLE.itemsize:
        corners = np.frombuffer(content, STL_TRIANGLE, offset=STL_START)["corners"].reshape(-1, 3)
    elif content.lstrip()[:5].lower() == b"solid" and b"\0" not in content:
        words = [line.split()[1:] for line in content.splitlines() if line.lstrip()[:6].lower() == b"vertex"]
        if len(words) % 3 or any(len(word) != 3 for word in words):
            raise ValueError("expected three vertices of three coordinates in each facet")
        corners = np.array(words, np.float64).reshape(-1, 3)
    else:
        expected = (
            f"expected {STL_START + count * STL_TRIANGLE.itemsize} for its {count} triangles" if count >= 0 else ""
        )
        raise ValueError(f"{len(content)} bytes, {expected or 'expected at least 84'}")
    vertices, faces = np.unique(corners.astype(np.float64) + 0.0, axis=0, return_inverse=True)
    return vertices, faces.reshape(-1, 3).astype(np.int64)


def parse_obj(content: bytes) -> VerticesAndFaces:
    """Vertices (`v`) and faces (`f`) of an OBJ file; all else in it is passed over."""
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    for line in content.splitlines():
        words = line.split()
        if words[:1] == [b"v"]:
            if len(words) < 4:
                raise ValueError(f"a vertex of {len(words) - 1} coordinates, expected three")
            vertices.append([float(word) for word in words[1:4]])
        elif words[:1] == [b"f"]:
            corners = [int(word.split(b"/")[0]) for word in words[1:]]
            faces += _fan([corner - 1 if corner > 0 else len(vertices) + corner for corner in corners])
    try:
        return np.array(vertices, np.float64).reshape(-1, 3), np.array(faces, np.int64).reshape(-1, 3)
    except OverflowError:
        raise ValueError("a face with a number too large for a vertex") from None


def parse_ply(content: bytes) -> VerticesAndFaces:
    """Vertices and faces of a PLY file, text or binary."""
    byte_order, elements, offset = _ply_header(content)
    body = content[offset:]
    vertices, faces = np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    reader = _PlyText(body) if byte_order is None else _PlyBinary(body, byte_order)
    for name, count, properties in elements:
        rows = reader.read(count, properties)
        if name == "vertex":
            missing = {"x", "y", "z"} - {key for key, value in rows.items() if isinstance(value, np.ndarray)}
            if missing:
                raise ValueError(f"vertices without {', '.join(sorted(missing))}")
            vertices = np.column_stack([np.asarray(rows[axis], np.float64) for axis in "xyz"])
        elif name == "face":
            polygons = rows.get("vertex_indices", rows.get("vertex_index"))
            if polygons is None:
                raise ValueError("faces without vertex_indices")
            faces = _triangles(polygons)
    return vertices, faces


Property = tuple[str, str | None, str]
"""Name, type of the length if it is a list, type of the value; types as numpy's, without byte order."""
Rows = dict[str, "NDArray[np.generic] | list[list[int]]"]
"""Property -> one value a row, or one list of integers a row."""


def _ply_header(content: bytes) -> tuple[str | None, list[tuple[str, int, list[Property]]], int]:
    end = content.find(b"end_header", 0, PLY_MAX_HEADER)
    if content[:3] != b"ply" or end < 0:
        raise ValueError("expected a header from 'ply' to 'end_header'")
    offset = content.find(b"\n", end) + 1
    if not offset:
        raise ValueError("expected a line break after 'end_header'")
    form, elements = "", list[tuple[str, int, list[Property]]]()
    for line in content[:end].decode("ascii", "replace").splitlines()[1:]:
        match line.split():
            case ["format", name, "1.0"]:
                form = name
            case ["element", name, count] if count.isdecimal() and len(count) < 12:
                elements.append((name, int(count), []))
            case ["property", "list", length, value, name] if elements and {length, value} <= PLY_TYPES.keys():
                elements[-1][2].append((name, PLY_TYPES[length], PLY_TYPES[value]))
            case ["property", value, name] if elements and value in PLY_TYPES:
                elements[-1][2].append((name, None, PLY_TYPES[value]))
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise ValueError(f"unknown header line {line[:60]!r}")
    for name, _, properties in elements:
        if len({key for key, _, _ in properties}) < len(properties):
            raise ValueError(f"a property of {name[:60]!r} stands twice")
    if form != "ascii" and form not in PLY_BYTE_ORDER:
        raise ValueError(f"format {form!r}, expected ascii or binary")
    return PLY_BYTE_ORDER.get(form), elements, offset


class _PlyBinary:
    """Reads element after element from the body of a binary file."""

    def __init__(self, body: bytes, byte_order: str) -> None:
        self._body, self._order, self._at = body, byte_order, 0

    def read(self, count: int, properties: list[Property]) -> Rows:
        if any(length for _, length, _ in properties):
            return self._read_lists(count, properties)
        dtype = np.dtype([(name, self._order + value) for name, _, value in properties])
        rows = np.frombuffer(self._take(count * dtype.itemsize), dtype) if dtype.itemsize else np.zeros(0, dtype)
        return {name: rows[name] for name, _, _ in properties}

    def _read_lists(self, count: int, properties: list[Property]) -> Rows:
        triangles = self._read_triangles(count, properties)
        if triangles is not None:
            return triangles
        rows: dict[str, list[list[int]]] = {name: [] for name, _, _ in properties}
        for _ in range(count):
            for name, length, value in properties:
                items = int(self._values(length, 1)[0]) if length else 1
                rows[name].append(self._values(value, items).astype(np.int64).tolist())
        return dict(rows)

    def _read_triangles(self, count: int, properties: list[Property]) -> Rows | None:
        """Almost all files hold one list a face, of three vertices: those need no loop."""
        if len(properties) != 1:
            return None
        name, length, value = properties[0]
        dtype = np.dtype([("length", f"{self._order}{length}"), ("items", f"{self._order}{value}", 3)])
        size = count * dtype.itemsize
        if size > len(self._body) - self._at:
            return None
        rows = np.frombuffer(self._body, dtype, count, self._at)
        if np.any(rows["length"] != 3):
            return None
        self._at += size
        return {name: rows["items"]}

    def _values(self, kind: str, count: int) -> NDArray[np.generic]:
        dtype = np.dtype(self._order + kind)
        return np.frombuffer(self._take(count * dtype.itemsize), dtype)

    def _take(self, size: int) -> bytes:
        if not 0 <= size <= len(self._body) - self._at:
            raise ValueError(f"ends after {len(self._body)} bytes of data, expected more")
        self._at += size
        return self._body[self._at - size : self._at]


class _PlyText:
    """Reads element after element from the body of a text file, one row a line."""

    def __init__(self, body: bytes) -> None:
        self._lines = body.split(b"\n")
        self._at = 0

    def read(self, count: int, properties: list[Property]) -> Rows:
        lines = self._lines[self._at : self._at + count]
        self._at += count
        if len(lines) < count:
            raise ValueError(f"ends after {len(lines)} lines of an element, expected {count}")
        words = [line.split() for line in lines]
        if not any(length for _, length, _ in properties):
            if any(len(row) < len(properties) for row in words):
                raise ValueError(f"a line of too few values, expected {len(properties)}")
            return {name: np.array([float(row[k]) for row in words]) for k, (name, _, _) in enumerate(properties)}
        rows: dict[str, list[list[int]]] = {name: [] for name, _, _ in properties}
        for row in words:
            at = 0
            for name, length, _ in properties:
                items = int(row[at]) if length and at < len(row) else 1
                at += length is not None
                if items < 0 or at + items > len(row):
                    raise ValueError("a line of too few values")
                rows[name].append([int(float(word)) for word in row[at : at + items]])
                at += items
        return dict(rows)


def _triangles(polygons: "NDArray[np.generic] | list[list[int]]") -> NDArray[np.int64]:
    if isinstance(polygons, np.ndarray):
        return polygons.astype(np.int64).reshape(-1, 3)
    return np.array([triangle for polygon in polygons for triangle in _fan(polygon)], np.int64).reshape(-1, 3)


def _fan(polygon: list[int]) -> list[list[int]]:
    return [[polygon[0], polygon[k], polygon[k + 1]] for k in range(1, len(polygon) - 1)]

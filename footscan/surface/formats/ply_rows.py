"""Rows of the elements of a PLY file. What breaks the format raises a ValueError that says how.

Files come from outside: every count in one is held against the bytes that are there before anything is allocated.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.surface.mesh import KNOWN_OF_A_MESH

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
BYTE_ORDER = {"binary_little_endian": "<", "binary_big_endian": ">"}
MAX_HEADER = 2**16
Property = tuple[str, str | None, str]
"""Name, type of the length if it is a list, type of the value; types as numpy's, without byte order."""
Rows = dict[str, "NDArray[np.generic] | list[list[int]]"]
"""Property -> one value a row, or one list of integers a row."""


class Header(NamedTuple):
    """What a PLY file tells of itself."""

    byte_order: str | None
    """As numpy writes it; None of text."""
    elements: list[tuple[str, int, list[Property]]]
    """Name and number of rows of each, in the order of the file."""
    metadata: dict[str, str]
    """Of comments that begin with a key of ours."""
    body: int
    """Where the rows begin."""


def ply_rows(content: bytes) -> tuple[Header, dict[str, Rows]]:
    """The header, and the rows of every element."""
    header = _header(content)
    body = content[header.body :]
    reader = _Text(body) if header.byte_order is None else _Binary(body, header.byte_order)
    return header, {name: reader.read(count, properties) for name, count, properties in header.elements}


def _header(content: bytes) -> Header:
    """What stands before `end_header`; ValueError where it breaks the format."""
    end = content.find(b"end_header", 0, MAX_HEADER)
    if content[:3] != b"ply" or end < 0:
        raise ValueError("expected a header from 'ply' to 'end_header'")
    offset = content.find(b"\n", end) + 1
    if not offset:
        raise ValueError("expected a line break after 'end_header'")
    form, elements = "", list[tuple[str, int, list[Property]]]()
    lines = content[:end].decode("ascii", "replace").splitlines()[1:]
    for line in lines:
        match line.split():
            case ["format", name, "1.0"]:
                form = name
            case ["element", name, count] if count.isdecimal() and len(count) < 12:
                elements.append((name, int(count), []))
            case ["property", "list", length, value, name] if elements and {length, value} <= TYPES.keys():
                elements[-1][2].append((name, TYPES[length], TYPES[value]))
            case ["property", value, name] if elements and value in TYPES:
                elements[-1][2].append((name, None, TYPES[value]))
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise ValueError(f"unknown header line {line[:60]!r}")
    for name, _, properties in elements:
        if len({key for key, _, _ in properties}) < len(properties):
            raise ValueError(f"a property of {name[:60]!r} stands twice")
    if form != "ascii" and form not in BYTE_ORDER:
        raise ValueError(f"format {form!r}, expected ascii or binary")
    return Header(BYTE_ORDER.get(form), elements, _metadata(lines), offset)


def _metadata(lines: list[str]) -> dict[str, str]:
    comments = [line.split(maxsplit=2)[1:] for line in lines if line.split(maxsplit=1)[:1] == ["comment"]]
    return {words[0]: words[1].strip() for words in comments if len(words) == 2 and words[0] in KNOWN_OF_A_MESH}


class _Binary:
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


class _Text:
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

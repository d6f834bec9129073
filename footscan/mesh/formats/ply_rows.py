"""Rows of the elements of a PLY file. A file that breaks the format raises a ValueError that says how.

Files come from outside: every count in a file is checked against its size before memory is allocated.
"""

import struct
from array import array
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.formats.polygons import PolygonList, Polygons
from footscan.mesh.formats.text import lines_of
from footscan.mesh.mesh import METADATA_KEYS
from schemas.base.limits import refuse_beyond

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
CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}
"""Codes of the module `struct`."""
LENGTHS = [name for name, kind in TYPES.items() if kind[0] != "f"]
BYTE_ORDER = {"binary_little_endian": "<", "binary_big_endian": ">"}
MAX_HEADER = 2**16
"""Bound of memory and time: bytes of a header."""
Property = tuple[str, str | None, str]
"""Name, type of the length (only of a list), type of the value; types of numpy without byte order."""
Rows = dict[str, "NDArray[np.generic] | Polygons"]
"""Property -> one value per row, or one list of integers per row; of an element with lists, only its lists."""


class Header(NamedTuple):
    """Header of a PLY file."""

    byte_order: str | None
    """In the notation of numpy; None for text"""
    elements: list[tuple[str, int, list[Property]]]
    """Name, number of rows and properties of each element, in the order of the file"""
    metadata: dict[str, str]
    """From comments that begin with one of `METADATA_KEYS`"""
    body: int
    """Offset of the rows"""


def ply_rows(content: bytes) -> tuple[Header, dict[str, Rows]]:
    """Read the header and the rows of every element."""
    header = _header(content)
    body = content[header.body :]
    reader = _Text(body) if header.byte_order is None else _Binary(body, header.byte_order)
    return header, {name: reader.read(count, properties) for name, count, properties in header.elements}


def _header(content: bytes) -> Header:
    """Read the header; raises ValueError if it breaks the format."""
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
                refuse_beyond("mesh_rows", int(count), "mesh")
                elements.append((name, int(count), []))
            case ["property", "list", length, value, name] if elements and length in LENGTHS and value in TYPES:
                elements[-1][2].append((name, TYPES[length], TYPES[value]))
            case ["property", value, name] if elements and value in TYPES:
                elements[-1][2].append((name, None, TYPES[value]))
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise ValueError(f"unknown header line {line[:60]!r}")
    for name, _, properties in elements:
        if len({key for key, _, _ in properties}) < len(properties):
            raise ValueError(f"a property of {name[:60]!r} is listed twice")
    if form != "ascii" and form not in BYTE_ORDER:
        raise ValueError(f"format {form!r}, expected ascii or binary")
    return Header(BYTE_ORDER.get(form), elements, _metadata(lines), offset)


def _metadata(lines: list[str]) -> dict[str, str]:
    comments = [line.split(maxsplit=2)[1:] for line in lines if line.split(maxsplit=1)[:1] == ["comment"]]
    return {words[0]: words[1].strip() for words in comments if len(words) == 2 and words[0] in METADATA_KEYS}


class _Binary:
    """Reader of element after element from the body of a binary file."""

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
        lists = {name: PolygonList() for name, length, _ in properties if length}
        if len(properties) == 1:
            name, length, value = properties[0]
            self._read_list(count, length or "", value, lists[name])
            return {name: lists[name].polygons()}
        for _ in range(count):
            for name, length, value in properties:
                items = int(self._values(length, 1)[0]) if length else 1
                values = self._values(value, items)
                if length:
                    lists[name].add(map(_whole, values))
        return {name: polygons.polygons() for name, polygons in lists.items()}

    def _read_triangles(self, count: int, properties: list[Property]) -> Rows | None:
        """Read without a loop if each face is one list of three vertices, as in almost all files; None otherwise."""
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

    def _read_list(self, count: int, length: str, value: str, polygons: PolygonList) -> None:
        """Read one list per row; there are millions, so a row must take no more than a microsecond."""
        length_of, head, width = struct.Struct(self._order + CODES[length]), int(length[1]), int(value[1])
        body, at = self._body, self._at
        for _ in range(count):
            if at + head > len(body):
                raise self._end()
            (items,) = length_of.unpack_from(body, at)
            at += head
            if items < 0 or at + items * width > len(body):
                raise self._end()
            values = struct.unpack_from(f"{self._order}{items}{CODES[value]}", body, at) if items else ()
            polygons.add(values if value[0] != "f" else map(_whole, values))
            at += items * width
        self._at = at

    def _values(self, kind: str, count: int) -> tuple[float, ...]:
        size = count * int(kind[1])
        if not 0 <= size <= len(self._body) - self._at:
            raise self._end()
        self._at += size
        return struct.unpack_from(f"{self._order}{count}{CODES[kind]}", self._body, self._at - size)

    def _take(self, size: int) -> bytes:
        if not 0 <= size <= len(self._body) - self._at:
            raise self._end()
        self._at += size
        return self._body[self._at - size : self._at]

    def _end(self) -> ValueError:
        return ValueError(f"ends after {len(self._body)} bytes of data, expected more")


class _Text:
    """Reader of element after element from the body of a text file, one row per line."""

    def __init__(self, body: bytes) -> None:
        self._lines = lines_of(body)

    def read(self, count: int, properties: list[Property]) -> Rows:
        rows = self._rows(count)
        if any(length for _, length, _ in properties):
            return _lists_of(rows, properties)
        width = len(properties)
        values = array("d")
        for words in rows:
            if len(words) < width:
                raise ValueError(f"a line of too few values, expected {width}")
            values.extend(map(float, words[:width]))
        table = np.array(values, np.float64).reshape(-1, max(width, 1))
        return {name: table[:, k] for k, (name, _, _) in enumerate(properties)}

    def _rows(self, count: int) -> Iterator[list[bytes]]:
        for number in range(count):
            line = next(self._lines, None)
            if line is None:
                raise ValueError(f"ends after {number} lines of an element, expected {count}")
            yield line.split()


def _lists_of(rows: Iterable[list[bytes]], properties: list[Property]) -> Rows:
    lists = {name: PolygonList() for name, length, _ in properties if length}
    for words in rows:
        at = 0
        for name, length, _ in properties:
            items = int(words[at]) if length and at < len(words) else 1
            at += length is not None
            if items < 0 or at + items > len(words):
                raise ValueError("a line of too few values")
            if length:
                lists[name].add(_whole(float(word)) for word in words[at : at + items])
            at += items
    return {name: polygons.polygons() for name, polygons in lists.items()}


def _whole(value: float) -> int:
    """The number of a vertex; raises ValueError if it is infinite or NaN."""
    try:
        return int(value)
    except OverflowError:
        raise ValueError("a list with a number that is infinite") from None

"""STL files, written as binary, read as binary or text. They hold triangles and a header of 80 characters."""

import re
from array import array
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.formats.text import lines_of
from footscan.mesh.mesh import METADATA_KEYS, Mesh
from footscan.rows import distinct_rows

START = 84
"""Offset of the triangles: 80 bytes of header and 4 bytes of count."""
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def stl_of(mesh: Mesh) -> bytes:
    """Encode a binary STL file whose header has unit, side, and as much of the metadata as there is room for."""
    return stl_bytes(mesh.vertices, mesh.faces, _header(mesh.metadata))


def stl_bytes(vertices: NDArray[np.floating], faces: NDArray[np.integer], header: str) -> bytes:
    """Encode a binary STL file.

    Parameters
    ----------
    vertices : (V, 3) mm
    faces : (F, 3)
    header : at most 80 ASCII characters, such as "footscan unit=mm side=right"; must not begin with "solid", by which
        readers recognise an STL file of text

    Raises
    ------
    ValueError
        The header is too long or begins with "solid".
    """
    encoded = header.encode("ascii", "replace")
    if encoded.lower().startswith(b"solid") or len(encoded) > 80:
        raise ValueError(f"STL header {header!r}, expected at most 80 characters that do not begin with 'solid'")
    corners = np.asarray(vertices, np.float64)[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    triangles = np.zeros(len(faces), TRIANGLE)
    triangles["normal"] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    triangles["corners"] = corners
    return encoded.ljust(80, b"\0") + len(faces).to_bytes(4, "little") + triangles.tobytes()


def parse_stl(content: bytes) -> Mesh:
    """Read a binary or text STL file and merge equal vertices; raises ValueError if the file breaks the format."""
    count = int.from_bytes(content[80:START], "little") if len(content) >= START else -1
    metadata: dict[str, str] = {}
    if len(content) == START + count * TRIANGLE.itemsize:
        corners = np.frombuffer(content, TRIANGLE, offset=START)["corners"].reshape(-1, 3)
        metadata = _metadata(content[:80])
    elif content.lstrip()[:5].lower() == b"solid" and b"\0" not in content:
        corners = _corners(content)
    elif content and b"\0" not in content:
        raise ValueError("is text that does not begin with 'solid', expected STL")
    else:
        expected = f"expected {START + count * TRIANGLE.itemsize} for its {count} triangles" if count >= 0 else ""
        raise ValueError(f"{len(content)} bytes, {expected or 'expected at least 84'}")
    merged = distinct_rows(corners.astype(np.float64) + 0.0)
    return Mesh(merged.rows, merged.number.reshape(-1, 3).astype(np.int32), metadata=metadata)


def _corners(content: bytes) -> NDArray[np.float64]:
    """Returns (3 F, 3) the vertices of a text file."""
    numbers, last = array("d"), b""
    for line in lines_of(content):
        words = line.split()
        if words and words[0].lower() == b"vertex":
            if len(words) != 4:
                raise ValueError("expected three vertices of three coordinates in each facet")
            numbers.extend(map(float, words[1:]))
        last = line if words else last
    if not last.lstrip().lower().startswith(b"endsolid"):
        raise ValueError("ends without 'endsolid', expected a whole text")
    if len(numbers) % 9:
        raise ValueError("expected three vertices of three coordinates in each facet")
    return np.array(numbers, np.float64).reshape(-1, 3)


def _header(metadata: Mapping[str, str]) -> str:
    first = {"unit": "mm", "side": metadata.get("side", "unknown")}
    header = "footscan"
    for key, value in {**first, **metadata}.items():
        word = f" {key}={re.sub(r'[^!-~]', '_', value)}"
        header += word if len(header + word) <= 80 else ""
    return header


def _metadata(header: bytes) -> dict[str, str]:
    words = header.rstrip(b"\0").decode("ascii", "replace").split()
    pairs = [word.partition("=") for word in words]
    return {key: value for key, _, value in pairs if key in METADATA_KEYS and value}

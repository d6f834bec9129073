"""GLB, the binary form of glTF 2.0 (ISO/IEC 12113): metres, Y up, colours in linear light."""

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.mesh import Mesh

FLOAT, UNSIGNED_INT = 5126, 5125
"""`accessor.componentType` of glTF 2.0."""
VERTICES, INDICES = 34962, 34963
"""`bufferView.target` of glTF 2.0: vertex attributes, and indices of vertices."""


def glb_of(mesh: Mesh) -> bytes:
    """Encode a GLB file: X stays, Y of the standard is our Z. Programs with Z up, such as Blender, turn it back.

    Camera of origin and filled, if known, are the attributes `_CAMERA` and `_FILLED` of the vertices.
    """
    buffer = _Buffer()
    attributes = {"POSITION": buffer.add(_y_up(mesh.vertices) / 1000, "VEC3", VERTICES, bounds=True)}
    if mesh.normals is not None:
        attributes["NORMAL"] = buffer.add(_y_up(mesh.normals), "VEC3", VERTICES)
    if mesh.colours is not None:
        # As floats: programs differ in how they read whole numbers here.
        attributes["COLOR_0"] = buffer.add(_linear(mesh.colours), "VEC3", VERTICES)
    for name, values in (("_CAMERA", mesh.camera), ("_FILLED", mesh.filled)):
        if values is not None:
            attributes[name] = buffer.add(values.astype(np.float64), "SCALAR", VERTICES)
    indices = buffer.add(mesh.faces.ravel(), "SCALAR", INDICES)
    primitive = {"attributes": attributes, "indices": indices, "material": 0}
    extras = {**mesh.metadata, "unit": "m"}
    document = {
        "asset": {"version": "2.0", "generator": mesh.metadata.get("software", "footscan")},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "foot", "extras": extras}],
        "meshes": [{"name": "foot", "primitives": [primitive], "extras": extras}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.8}, "doubleSided": True}],
        **buffer.document(),
    }
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    body = _chunk(b"JSON", text, b" ") + _chunk(b"BIN\0", bytes(buffer.data), b"\0")
    return b"glTF" + np.array([2, 12 + len(body)], "<u4").tobytes() + body


class _Buffer:
    """The arrays of a file, one after the other."""

    def __init__(self) -> None:
        self.data = bytearray()
        self._views: list[dict[str, int]] = []
        self._accessors: list[dict[str, Any]] = []

    def add(
        self, values: NDArray[np.floating] | NDArray[np.integer], kind: str, target: int, *, bounds: bool = False
    ) -> int:
        """Append an array with four bytes per number; returns the number of its accessor."""
        component, stored_as = (FLOAT, "<f4") if values.dtype.kind == "f" else (UNSIGNED_INT, "<u4")
        stored = values.astype(stored_as)
        accessor: dict[str, Any] = {"componentType": component, "count": len(stored), "type": kind}
        if bounds:
            accessor |= {"min": stored.min(axis=0).tolist(), "max": stored.max(axis=0).tolist()}
        self._accessors.append({"bufferView": len(self._views), **accessor})
        self._views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": stored.nbytes, "target": target})
        self.data += stored.tobytes()  # always a multiple of four bytes
        return len(self._accessors) - 1

    def document(self) -> dict[str, Any]:
        buffers = [{"byteLength": len(self.data)}]
        return {"accessors": self._accessors, "bufferViews": self._views, "buffers": buffers}


def _y_up(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([vectors[:, 0], vectors[:, 2], -vectors[:, 1]]) + 0.0


def _linear(colours: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Returns linear light from 0 to 1 of sRGB levels from 0 to 255 (IEC 61966-2-1)."""
    level = colours / 255
    return np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)


def _chunk(kind: bytes, data: bytes, filler: bytes) -> bytes:
    padded = data + filler * (-len(data) % 4)
    return len(padded).to_bytes(4, "little") + kind + padded

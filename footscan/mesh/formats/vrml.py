"""VRML 2 files (ISO/IEC 14772-1). The standard counts in metres, but CAD programs read mm, and mm are written."""

import numpy as np

from footscan.mesh.formats.text import coordinates, metadata_lines
from footscan.mesh.mesh import Mesh


def vrml_of(mesh: Mesh) -> bytes:
    """Encode a VRML 2 file in mm, Z up, with colours and normals if there are any."""
    info = ", ".join(_quoted(line) for line in metadata_lines(mesh.metadata))
    of_vertices = ""
    if mesh.normals is not None:
        of_vertices += f"normal Normal {{ vector [\n{_rows(mesh.normals)}\n] }}\nnormalPerVertex TRUE\n"
    if mesh.colours is not None:
        of_vertices += f"color Color {{ color [\n{_rows(mesh.colours / 255)}\n] }}\ncolorPerVertex TRUE\n"
    triangles = ",\n".join(f"{a},{b},{c},-1" for a, b, c in mesh.faces.tolist())
    return (
        "#VRML V2.0 utf8\n"
        f'WorldInfo {{ title "foot" info [ {info} ] }}\n'
        "Shape {\nappearance Appearance { material Material { diffuseColor 0.8 0.8 0.8 } }\n"
        "geometry IndexedFaceSet {\nccw TRUE\nsolid FALSE\n"
        f"coord Coordinate {{ point [\n{_rows(mesh.vertices)}\n] }}\n{of_vertices}"
        f"coordIndex [\n{triangles}\n]\n}}\n}}\n"
    ).encode()


def _rows(values: "np.ndarray[tuple[int, ...], np.dtype[np.floating]]") -> str:
    return ",\n".join(" ".join(row) for row in coordinates(values))


def _quoted(line: str) -> str:
    escaped = line.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'

"""OBJ, text. Colours stand behind the coordinates of a vertex, as most programs read them."""

import numpy as np

from footscan.surface.formats.polygons import fan, vertex_numbers
from footscan.surface.formats.text import coordinates, described
from footscan.surface.mesh import Mesh


def obj_of(mesh: Mesh) -> bytes:
    """An OBJ file, with colours and normals where there are any."""
    rows = mesh.vertices if mesh.colours is None else np.column_stack([mesh.vertices, mesh.colours / 255])
    lines = [f"# {line}" for line in described(mesh.metadata)]
    lines += ["o foot", *(f"v {' '.join(row)}" for row in coordinates(rows))]
    corner = "{0}"
    if mesh.normals is not None:
        lines += [f"vn {' '.join(row)}" for row in coordinates(mesh.normals)]
        corner = "{0}//{0}"
    lines += [f"f {' '.join(corner.format(vertex) for vertex in face)}" for face in (mesh.faces + 1).tolist()]
    return "\n".join([*lines, ""]).encode()


def parse_obj(content: bytes) -> Mesh:
    """Vertices (`v`), with colours where all have them, and faces (`f`); all else in the file is passed over."""
    rows: list[list[float]] = []
    faces: list[list[int]] = []
    for line in content.splitlines():
        words = line.split()
        if words[:1] == [b"v"]:
            if len(words) < 4:
                raise ValueError(f"a vertex of {len(words) - 1} coordinates, expected three")
            rows.append([float(word) for word in words[1:7]])
        elif words[:1] == [b"f"]:
            corners = [int(word.split(b"/")[0]) for word in words[1:]]
            faces += fan([corner - 1 if corner > 0 else len(rows) + corner for corner in corners])
    vertices = np.array([row[:3] for row in rows], np.float64).reshape(-1, 3)
    colours = None
    if rows and all(len(row) == 6 for row in rows):
        colours = np.rint(np.clip(np.nan_to_num([row[3:] for row in rows]), 0, 1) * 255).astype(np.uint8)
    return Mesh(vertices, vertex_numbers(faces), colours=colours)

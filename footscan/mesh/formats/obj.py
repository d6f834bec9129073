"""OBJ files. Colours follow the coordinates of a vertex, as most programs read them."""

from array import array

import numpy as np

from footscan.mesh.formats.polygons import PolygonList, fans
from footscan.mesh.formats.text import coordinates, lines_of, metadata_lines
from footscan.mesh.mesh import Mesh


def obj_of(mesh: Mesh) -> bytes:
    """Encode an OBJ file, with colours and normals if there are any."""
    rows = mesh.vertices if mesh.colours is None else np.column_stack([mesh.vertices, mesh.colours / 255])
    lines = [f"# {line}" for line in metadata_lines(mesh.metadata)]
    lines += ["o foot", *(f"v {' '.join(row)}" for row in coordinates(rows))]
    corner = "{0}"
    if mesh.normals is not None:
        lines += [f"vn {' '.join(row)}" for row in coordinates(mesh.normals)]
        corner = "{0}//{0}"
    lines += [f"f {' '.join(corner.format(vertex) for vertex in face)}" for face in (mesh.faces + 1).tolist()]
    return "\n".join([*lines, ""]).encode()


def parse_obj(content: bytes) -> Mesh:
    """Read vertices (`v`), with colours if all have them, and faces (`f`); everything else in the file is ignored."""
    places, colours, faces = array("d"), array("d"), PolygonList()
    for line in lines_of(content):
        words = line.split()
        if words[:1] == [b"v"]:
            if len(words) < 4:
                raise ValueError(f"a vertex of {len(words) - 1} coordinates, expected three")
            places.extend(map(float, words[1:4]))
            colours.extend(map(float, words[4:7] if len(words) >= 7 else ()))
        elif words[:1] == [b"f"]:
            count = len(places) // 3
            corners = (int(word.partition(b"/")[0]) for word in words[1:])
            faces.add(corner - 1 if corner > 0 else count + corner for corner in corners)
    vertices = np.array(places, np.float64).reshape(-1, 3)
    levels = np.array(colours, np.float64).reshape(-1, 3)
    is_coloured = 0 < len(levels) == len(vertices)
    coloured = np.rint(np.clip(np.nan_to_num(levels), 0, 1) * 255).astype(np.uint8) if is_coloured else None
    return Mesh(vertices, fans(faces.polygons()), colours=coloured)

"""The mesh as foot.ply, with all attributes of its vertices."""

import json
from collections.abc import Mapping
from pathlib import Path

from footscan.mesh.formats.ply import ply_of
from footscan.mesh.mesh import Mesh
from pipelines.arrays import unpack
from schemas.parameters.foot import FootParameters


def run(inputs: Mapping[str, bytes], parameters: FootParameters, places: Mapping[str, Path]) -> bytes:
    """Write the mesh with all attributes of its vertices as PLY.

    `inputs`: `surface`, the scan's `name` and, if cameras have laser-off frames, `texture`.
    """
    del places
    surface, name = unpack(inputs["surface"]), json.loads(inputs["name"])
    mesh = Mesh(
        surface["vertices"],
        surface["faces"],
        surface["normals"],
        unpack(inputs["texture"]).get("colours") if "texture" in inputs else None,
        surface.get("camera"),
        surface.get("filled"),
        {"patient": name["patient"], "scan": name["scan"], "side": parameters.side, "frame": "scanner"},
    )
    return ply_of(mesh)

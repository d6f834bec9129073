"""The cloud with its normals to a triangle mesh."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.surface.surface_of_cloud import surface_of_cloud, tip_doubts_mm
from pipelines.arrays import pack, unpack
from schemas.parameters.surface import SurfaceParameters


def run(inputs: Mapping[str, bytes], parameters: SurfaceParameters, places: Mapping[str, Path]) -> bytes:
    """Reconstruct the surface of the cloud.

    `inputs`: `oriented`. The result holds `vertices` and `faces`, the optional attributes of the mesh, and how doubtful
    the tips of its ends are, `tip_doubts`, mm.
    """
    del places
    oriented = unpack(inputs["oriented"])
    mesh = surface_of_cloud(oriented["cloud"], oriented["normals"], parameters)
    optional = {"normals": mesh.normals, "camera": mesh.camera, "filled": mesh.filled}
    cut = {"cut_mm": np.array(float(mesh.metadata["cut_mm"]))} if "cut_mm" in mesh.metadata else {}
    attributes = {name: values for name, values in optional.items() if values is not None}
    return pack(vertices=mesh.vertices, faces=mesh.faces, tip_doubts=np.array(tip_doubts_mm(mesh)), **attributes, **cut)

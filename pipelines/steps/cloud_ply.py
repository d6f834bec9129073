"""The cleaned cloud as cloud.ply."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.cloud.points import coordinates
from footscan.mesh.formats.ply import ply_of
from footscan.mesh.mesh import Mesh
from pipelines.arrays import unpack


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Write the cleaned cloud with its normals as PLY.

    `inputs`: `oriented`.
    """
    del parameters, places
    oriented = unpack(inputs["oriented"])
    cloud = oriented["cloud"]
    no_faces = np.zeros((0, 3), np.int32)
    points = Mesh(
        coordinates(cloud), no_faces, oriented["normals"], camera=cloud["camera"], metadata={"frame": "scanner"}
    )
    return ply_of(points)

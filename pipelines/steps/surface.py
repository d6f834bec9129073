"""Cloud with normals to a triangle mesh."""

from collections.abc import Mapping
from pathlib import Path

from footscan.cloud.points import coordinates
from footscan.surface.ball_pivoting import mesh_cloud
from pipelines.arrays import pack, unpack
from schemas.parameters.surface import SurfaceParameters


def run(inputs: Mapping[str, bytes], parameters: SurfaceParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `oriented`."""
    del places
    oriented = unpack(inputs["oriented"])
    vertices, faces = mesh_cloud(coordinates(oriented["cloud"]), oriented["normals"], parameters)
    return pack(vertices=vertices, faces=faces)

"""Cloud with normals to a triangle mesh."""

from collections.abc import Mapping
from pathlib import Path

from footscan.cloud.points import coordinates, stripe_step
from footscan.surface.ball_pivoting import mesh_cloud
from pipelines.arrays import pack, unpack
from schemas.parameters.surface import SurfaceParameters


def run(inputs: Mapping[str, bytes], parameters: SurfaceParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `oriented`."""
    del places
    oriented = unpack(inputs["oriented"])
    cloud = oriented["cloud"]
    vertices, faces = mesh_cloud(coordinates(cloud), oriented["normals"], stripe_step(cloud), parameters)
    return pack(vertices=vertices, faces=faces)

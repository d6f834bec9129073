"""The cleaned cloud as cloud.ply."""

from collections.abc import Mapping
from pathlib import Path

from footscan.cloud.points import coordinates
from footscan.surface.export import cloud_ply_bytes
from pipelines.arrays import unpack


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `oriented`."""
    del parameters, places
    oriented = unpack(inputs["oriented"])
    cloud = oriented["cloud"]
    return cloud_ply_bytes(coordinates(cloud), oriented["normals"], cloud["camera"], ("unit mm", "frame scanner"))

"""World points of all cameras to one cloud."""

from collections.abc import Mapping
from pathlib import Path

from footscan.cloud.fusion import fuse
from pipelines.arrays import pack, unpack
from schemas.errors import Finding
from schemas.parameters.fusion import FusionParameters


def run(inputs: Mapping[str, bytes], parameters: FusionParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: the points of each camera, by any name."""
    del places
    cloud = fuse([unpack(points)["points"] for points in inputs.values()], parameters)
    if not len(cloud):
        raise Finding("no stripe in any camera, expected a foot in the films")
    return pack(cloud=cloud)

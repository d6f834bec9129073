"""Normals of the cleaned cloud."""

from collections.abc import Mapping
from pathlib import Path

from footscan.cloud.normals import estimate_normals
from pipelines.arrays import pack, unpack
from schemas.parameters.normals import NormalParameters


def run(inputs: Mapping[str, bytes], parameters: NormalParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `clean`."""
    del places
    cloud = unpack(inputs["clean"])["cloud"]
    return pack(cloud=cloud, normals=estimate_normals(cloud, parameters))

"""Mesh to measures.json."""

from collections.abc import Mapping
from pathlib import Path

from footscan.measure.basic import measure_foot
from pipelines.arrays import unpack
from schemas.parameters.foot import FootParameters


def run(inputs: Mapping[str, bytes], parameters: FootParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `surface`."""
    del places
    surface = unpack(inputs["surface"])
    measures = measure_foot(surface["vertices"], surface["faces"], parameters.side)
    return (measures.model_dump_json(indent=2) + "\n").encode()

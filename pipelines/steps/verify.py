"""Distances of the surface to the scan's reference model."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.surface.export import read_mesh
from footscan.verify.compare import compare
from footscan.verify.distances import signed_distances
from pipelines.arrays import pack, unpack


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `surface`, `truth`; `places`: the `truth` model."""
    del parameters
    surface = unpack(inputs["surface"])
    truth = read_mesh(places["truth"])
    comparison = compare((surface["vertices"], surface["faces"]), truth)
    return pack(
        comparison=np.frombuffer(comparison.model_dump_json().encode(), np.uint8),
        vertex_distance=signed_distances(surface["vertices"], truth),
    )

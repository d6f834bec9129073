"""Mesh to measures.json."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.measure.basic import measure_foot
from pipelines.arrays import unpack
from schemas.errors import Finding
from schemas.measures import Measures
from schemas.parameters.foot import FootParameters


def run(inputs: Mapping[str, bytes], parameters: FootParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `surface`."""
    del places
    surface = unpack(inputs["surface"])
    try:
        measures = measure_foot(surface["vertices"], surface["faces"], parameters.side)
    except Finding as finding:  # cloud and surface are worth having nevertheless
        unmoved = np.eye(4).tolist()
        measures = Measures(side=parameters.side, axis=None, transform=unmoved, measures={}, finding=str(finding))
    return (measures.model_dump_json(indent=2) + "\n").encode()

"""A step: the false share of the cloud of a scan, and the covered share of its truth."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.cloud.points import coordinates
from footscan.mesh.formats.files import read_mesh
from footscan.mesh.sampling import sample_surface
from footscan.verify.compare import SAMPLES, WITHIN_MM
from footscan.verify.distances import distances_to_mesh
from pipelines.arrays import unpack
from schemas.base.model import canonical_json


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `oriented`, `surface`, `truth`; `places`: the `truth` model.

    The result has the shares `false`, of the cloud farther than `WITHIN_MM` from the truth, and `there`, of the truth
    within `WITHIN_MM` of the surface.
    """
    del parameters
    surface = unpack(inputs["surface"])
    truth = read_mesh(places["truth"])
    off = distances_to_mesh(coordinates(unpack(inputs["oriented"])["cloud"]), truth).unsigned
    samples = sample_surface(*truth, SAMPLES)
    missed = distances_to_mesh(samples, (surface["vertices"], surface["faces"])).unsigned
    shares = {"false": float(np.mean(off > WITHIN_MM)), "there": float(np.mean(missed <= WITHIN_MM))}
    return canonical_json(shares).encode()

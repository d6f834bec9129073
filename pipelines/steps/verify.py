"""Distances of the surface to the scan's reference model; the flat cut of the leg is no skin and left out."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.mesh.formats.files import read_mesh
from footscan.surface.ankle import faces_on_cut
from footscan.verify.compare import compare
from footscan.verify.distances import SearchedMesh
from pipelines.arrays import pack, unpack


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `surface`, `truth`; `places`: the `truth` model."""
    del parameters
    surface = unpack(inputs["surface"])
    truth = read_mesh(places["truth"])
    vertices, faces = surface["vertices"], surface["faces"]
    cut_mm = surface["cut_mm"].item() if "cut_mm" in surface else None
    skin = faces[~faces_on_cut(vertices, faces, cut_mm)]
    searched = SearchedMesh(truth)
    comparison = compare((vertices, skin), truth, searched_b=searched)
    return pack(
        comparison=np.frombuffer(comparison.model_dump_json().encode(), np.uint8),
        vertex_distance=searched.signed_distances(vertices),
    )

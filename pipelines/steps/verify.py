"""Distances of the surface to the scan's reference model, without the flat cut of the leg, which is not skin."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.mesh.formats.files import read_mesh
from footscan.surface.ankle import faces_on_cut
from footscan.verify.compare import compare
from footscan.verify.distances import SearchedMesh
from pipelines.arrays import pack, unpack


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Compare the surface with the true model of the foot.

    `inputs`: `surface`, `truth`; `places`: the `truth` model. The result holds the `comparison` and the
    signed `vertex_distance` of each vertex, mm.
    """
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

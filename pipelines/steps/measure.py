"""Mesh to measures.json."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.measure.measures import measure_foot
from pipelines.arrays import unpack
from schemas.base.errors import Finding
from schemas.measures import Measures
from schemas.parameters.foot import FootParameters

ERROR_MM, ERROR_GROWS, REACH_MM = 0.03, 0.04, 10.0
"""Standard deviation of a measured vertex, and by how much it grows per mm where the surface was filled; vertices of a
smooth surface that lie so near to each other share theirs. From virtual feet: docs/surface.md."""
FORETOLD_MM = 5.0
"""So near to what was measured a smooth surface goes on as foretold."""


def run(inputs: Mapping[str, bytes], parameters: FootParameters, places: Mapping[str, Path]) -> bytes:
    """`inputs`: `surface`."""
    del places
    surface = unpack(inputs["surface"])
    vertices, filled = surface["vertices"], surface["filled"]
    gap_mm = _gaps(vertices, filled)
    try:
        measures = measure_foot(
            vertices,
            surface["faces"],
            parameters.side,
            errors_mm=ERROR_MM + ERROR_GROWS * gap_mm,
            reach_mm=REACH_MM,
            filled=gap_mm > FORETOLD_MM,
        )
    except Finding as finding:  # cloud and surface are worth having nevertheless
        unmoved = np.eye(4).tolist()
        measures = Measures(side=parameters.side, axis=None, transform=unmoved, measures={}, finding=str(finding))
    return (measures.model_dump_json(indent=2) + "\n").encode()


def _gaps(vertices: NDArray[np.float64], filled: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(V,) mm that each vertex lies from what was measured. The caps of heel and toes beyond the outermost stripes are
    broad, but less than a step high: there it is the distance along the travel that counts."""
    measured = vertices[~filled]
    gaps: NDArray[np.float64] = np.asarray(KDTree(measured).query(vertices)[0])
    beyond = np.maximum(measured[:, 0].min() - vertices[:, 0], vertices[:, 0] - measured[:, 0].max())
    return np.where(beyond > 0, beyond, gaps)

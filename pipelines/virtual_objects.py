"""The objects that the virtual scanner can film: a mesh from a file, the parametric foot, the block."""

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.formats.files import read_mesh
from footscan.virtual.foot.foot import make_foot
from footscan.virtual.stage.block import make_block
from schemas.base.errors import RefusedInput
from schemas.base.model import Side

Vertices = NDArray[np.float64]
Faces = NDArray[np.int64]

DIAGONAL_MM = (20.0, 600.0)
"""Smallest and largest diagonal of a mesh; others are in another unit or not the size of a foot. Chosen by hand."""


def virtual_object(
    mesh: Path | None, foot: Literal["right", "left"] | None, side: Side
) -> tuple[Vertices, Faces, Side]:
    """Load a mesh file, or make the parametric foot, or else the block.

    Returns
    -------
    vertices : (N, 3) float64, mm
    faces : (M, 3) int64
    side : `right`, `left` or `unknown`

    Raises
    ------
    RefusedInput
        The mesh cannot be read, or its size is not that of a foot.
    """
    if mesh is not None:
        vertices, faces = read_mesh(mesh)
        diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
        if not DIAGONAL_MM[0] <= diagonal <= DIAGONAL_MM[1]:
            low, high = DIAGONAL_MM
            problem = f"measures {diagonal:.3g} across, expected {low:g} to {high:g} mm: is it in millimetres?"
            raise RefusedInput(mesh, problem, field="unit")
        return vertices, faces.astype(np.int64), side
    if foot is not None:
        parametric_foot = make_foot(side=foot)
        return parametric_foot.vertices, parametric_foot.faces.astype(np.int64), foot
    vertices, faces = make_block()
    return vertices, faces.astype(np.int64), "unknown"

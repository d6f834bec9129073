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
    """Vertices (mm), faces and side of a mesh file, of the parametric foot, or else of the block."""
    if mesh is not None:
        vertices, faces = read_mesh(mesh)
        diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
        if not DIAGONAL_MM[0] <= diagonal <= DIAGONAL_MM[1]:
            low, high = DIAGONAL_MM
            problem = f"measures {diagonal:.3g} across, expected {low:g} to {high:g} mm: is it in millimetres?"
            raise RefusedInput(mesh, problem, field="unit")
        return vertices, faces.astype(np.int64), side
    if foot is not None:
        made = make_foot(side=foot)
        return made.vertices, made.faces.astype(np.int64), foot
    vertices, faces = make_block()
    return vertices, faces.astype(np.int64), "unknown"

"""Measures of any mesh of a foot: the function behind `footscan.measure(mesh)`."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from footscan.measure.bodies.raw_mesh import prepare_feet
from footscan.measure.partial import measure_raw
from footscan.mesh.formats.files import read_mesh
from footscan.mesh.mesh import Mesh
from schemas.base.errors import Finding
from schemas.base.model import Side
from schemas.measures import Axis, Measures


def measure(
    mesh: Path | str | Mesh | tuple[NDArray[np.floating], NDArray[np.integer]],
    side: Side = "unknown",
    axis: Axis = "toe2",
) -> Measures:
    """Measure the mesh of a foot from this scanner or any other, in any pose.

    Parameters
    ----------
    mesh : an STL, PLY or OBJ file, a `Mesh`, or (V, 3) vertices and (F, 3) faces; the unit (mm, cm, m or inches) is
        inferred from the size of a foot
    side : which foot it is; default: inferred from its form
    axis : the axis that lengths run along

    Raises
    ------
    RefusedInput
        The file is missing or broken.
    Finding
        The mesh is no foot, or holds two.

    Examples
    --------
    >>> from footscan.virtual.foot.foot import make_foot
    >>> foot = make_foot()
    >>> measures = measure((foot.vertices, foot.faces), side="right")
    >>> measures.measures["foot_length"].status
    'ok'
    """
    if isinstance(mesh, Mesh):
        vertices, faces = mesh.vertices, mesh.faces
    elif isinstance(mesh, tuple):
        vertices, faces = np.asarray(mesh[0], np.float64), np.asarray(mesh[1], np.int32)
    else:
        vertices, faces = read_mesh(Path(mesh))
    feet = prepare_feet(vertices, faces, None)
    if len(feet) > 1:
        raise Finding("the surface has 2 separate bodies, expected a single foot")
    return measure_raw(feet[0], side, axis)

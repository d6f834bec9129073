"""The measures of a foot that this scanner has scanned: its errors are known, and which surface was filled."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.measure.measures import measure_foot
from footscan.mesh.mesh import Mesh
from schemas.base.model import Side
from schemas.measures import Measures

ERROR_MM, ERROR_GROWS, REACH_MM = 0.03, 0.04, 10.0
"""Standard deviation of a measured vertex, and by how much it grows per mm where the surface was filled; vertices of a
smooth surface that lie so near to each other share theirs. From virtual feet: docs/surface.md."""
FORETOLD_MM = 5.0
"""So near to what was measured a smooth surface goes on as foretold."""


def measure_scanned_foot(mesh: Mesh, side: Side) -> Measures:
    """The measures of a scanned surface, with the uncertainty that follows from the scanner's errors.

    Parameters
    ----------
    mesh : in mm, scanner frame; `filled` is known

    Raises
    ------
    Finding
        The surface is no foot.
    """
    filled = np.zeros(len(mesh.vertices), bool) if mesh.filled is None else mesh.filled
    gap_mm = _gaps(mesh.vertices, filled)
    return measure_foot(
        mesh.vertices,
        mesh.faces,
        side,
        errors_mm=ERROR_MM + ERROR_GROWS * gap_mm,
        reach_mm=REACH_MM,
        filled=gap_mm > FORETOLD_MM,
    )


def _gaps(vertices: NDArray[np.float64], filled: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(V,) mm that each vertex lies from what was measured. The caps of heel and toes beyond the outermost stripes are
    broad, but less than a step high: there it is the distance along the travel that counts."""
    measured = vertices[~filled]
    gaps: NDArray[np.float64] = np.asarray(KDTree(measured).query(vertices)[0])
    beyond = np.maximum(measured[:, 0].min() - vertices[:, 0], vertices[:, 0] - measured[:, 0].max())
    return np.where(beyond > 0, beyond, gaps)

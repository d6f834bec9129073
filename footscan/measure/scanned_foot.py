"""Measures of a foot from this scanner, whose errors and filled parts are known."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.measure.measures import measure_foot
from footscan.mesh.mesh import Mesh
from schemas.base.model import Side
from schemas.measures import Measures

ERROR_MM, ERROR_GROWS, REACH_MM = 0.03, 0.04, 10.0
"""Standard deviation of a measured vertex, its growth per mm into filled surface, and the edge of the cubes whose
vertices share their error. Tuned on virtual feet: docs/surface.md."""
RELIABLE_MM = 5.0
"""Filled surface nearer than this to measured surface counts as measured: a smooth surface hardly errs there. Chosen by
hand."""


def measure_scanned_foot(mesh: Mesh, side: Side, calibration_doubt: str | None = None) -> Measures:
    """Measure a scanned surface; the uncertainties follow from the errors of the scanner.

    Parameters
    ----------
    mesh : mm, scanner frame; without `filled`, all vertices count as measured
    calibration_doubt : as in `measure_foot`

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
        filled=gap_mm > RELIABLE_MM,
        calibration_doubt=calibration_doubt,
    )


def _gaps(vertices: NDArray[np.float64], filled: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Returns (V,) distances in mm of the vertices from measured surface.

    The caps of heel and toes beyond the outermost stripes are broad, but less than one step high. Their distance is
    taken along the travel.
    """
    measured = vertices[~filled]
    gaps: NDArray[np.float64] = np.asarray(KDTree(measured).query(vertices)[0])
    beyond = np.maximum(measured[:, 0].min() - vertices[:, 0], vertices[:, 0] - measured[:, 0].max())
    return np.where(beyond > 0, beyond, gaps)

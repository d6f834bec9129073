"""Measures of a foot from this scanner, whose errors and filled parts are known."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.measure.measures import measure_foot
from footscan.mesh.mesh import Mesh
from footscan.mesh.topology import vertex_normals
from schemas.base.model import Side
from schemas.glass import GlassPlane
from schemas.measures import Measures

ERROR_MM, ERROR_GROWS, REACH_MM = 0.03, 0.04, 10.0
"""Standard deviation of a measured vertex, its growth per mm into filled surface, and the edge of the cubes whose
vertices share their error. Tuned on virtual feet: docs/surface.md."""
DOWN, SOLE_MM = -0.7, 20.0
"""The sole is what looks down, by the Z of its normal, up to this height above the lowest point. Chosen by hand."""
MOST_UNSEEN = 0.5
"""Share of the sole that may be filled. Of a virtual foot that four cameras see from below it is 0.02, of one that is
seen from above alone 0.9: the foot then stands on a sole that was made up, and its frame follows that."""
RELIABLE_MM = 5.0
"""Filled surface nearer than this to measured surface counts as measured: a smooth surface hardly errs there. Chosen by
hand."""


def measure_scanned_foot(mesh: Mesh, side: Side, glass: GlassPlane, doubts: Sequence[str] = ()) -> Measures:
    """Measure a scanned surface; the uncertainties follow from the errors of the scanner.

    Parameters
    ----------
    mesh : mm, scanner frame; without `filled`, all vertices count as measured. If most of the sole is filled, as with
        cameras above alone, all measures are uncertain: each is taken in the foot's own frame, which rests on the sole.
    glass : on which the foot stands
    doubts : as of `measure_foot`

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
        glass=glass,
        doubts=[*doubts, *filter(None, [_unseen_sole(mesh, filled)])],
    )


def _unseen_sole(mesh: Mesh, filled: NDArray[np.bool_]) -> str | None:
    """Say that the sole was not seen, if it was not."""
    normals = vertex_normals(mesh.vertices, mesh.faces) if mesh.normals is None else mesh.normals
    is_sole = (normals[:, 2] < DOWN) & (mesh.vertices[:, 2] < mesh.vertices[:, 2].min() + SOLE_MM)
    unseen = float(filled[is_sole].mean()) if is_sole.any() else 1.0
    return f"{100 * unseen:.0f} % of the sole was filled, not measured" if unseen > MOST_UNSEEN else None


def _gaps(vertices: NDArray[np.float64], filled: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Returns (V,) distances in mm of the vertices from measured surface.

    The caps of heel and toes beyond the outermost stripes are broad, but less than one step high. Their distance is
    taken along the travel.
    """
    measured = vertices[~filled]
    gaps: NDArray[np.float64] = np.asarray(KDTree(measured).query(vertices)[0])
    beyond = np.maximum(measured[:, 0].min() - vertices[:, 0], vertices[:, 0] - measured[:, 0].max())
    return np.where(beyond > 0, beyond, gaps)

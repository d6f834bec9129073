"""Measures of a foot from this scanner, whose errors and filled parts are known."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from footscan.measure.measures import measure_foot
from footscan.measure.replicates import REPLICATES
from footscan.mesh.mesh import Mesh
from footscan.mesh.topology import vertex_normals
from footscan.surface.errors.evidence import NO_EVIDENCE, Evidence
from footscan.surface.errors.scan_errors import scan_errors
from schemas.base.model import Side
from schemas.glass import GlassPlane
from schemas.measures import Axis, Measures

DOWN, SOLE_MM = -0.7, 20.0
"""The sole is what looks down, by the Z of its normal, up to this height above the lowest point. Chosen by hand."""
MOST_UNSEEN = 0.5
"""Share of the sole that may be filled. Of a virtual foot that four cameras see from below it is 0.02, of one that is
seen from above alone 0.9: the foot then stands on a sole that was made up, and its frame follows that."""


def measure_scanned_foot(
    mesh: Mesh,
    side: Side,
    glass: GlassPlane,
    doubts: Sequence[str] = (),
    evidence: Evidence = NO_EVIDENCE,
    axis: Axis = "toe2",
    manual: Mapping[str, NDArray[np.float64]] | None = None,
) -> Measures:
    """Measure a scanned surface; the uncertainties follow from the errors of the scanner.

    Parameters
    ----------
    mesh : mm, scanner frame; without `filled`, all vertices count as measured. If most of the sole is filled, as with
        cameras above alone, all measures are uncertain: each is taken in the foot's own frame, which rests on the sole.
    glass : on which the foot stands
    doubts : as of `measure_foot`
    evidence : what the scan shows of its errors; default: nothing speaks against it
    axis, manual : as of `measure_foot`

    Raises
    ------
    Finding
        The surface is no foot.
    """
    errors, reports = scan_errors(mesh, evidence), (evidence.movement, evidence.agreement)
    return measure_foot(
        mesh.vertices,
        mesh.faces,
        side,
        axis=axis,
        manual=manual,
        errors=errors.fields,
        count=REPLICATES,
        filled=errors.is_unseen,
        glass=glass,
        doubts=[
            *doubts,
            *filter(None, [_unseen_sole(mesh), *(report.doubt for report in reports if report is not None)]),
        ],
    )


def _unseen_sole(mesh: Mesh) -> str | None:
    """Say that the sole was not seen, if it was not."""
    if mesh.filled is None:
        return None
    vertices, filled, normals = mesh.vertices, mesh.filled, vertex_normals(mesh.vertices, mesh.faces)
    is_sole = (normals[:, 2] < DOWN) & (vertices[:, 2] < vertices[:, 2].min() + SOLE_MM)
    unseen = float(filled[is_sole].mean()) if is_sole.any() else 1.0
    if unseen <= MOST_UNSEEN:
        return None
    return (
        f"{100 * unseen:.0f} % of the sole was filled, not measured: see that nothing covers the cameras below the "
        "glass, then scan again"
    )

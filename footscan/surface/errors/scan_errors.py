"""The errors of a scanned surface from all causes."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.cloud.movement.pace import PACE_FRAMES, PACES_BETWEEN
from footscan.cloud.movement.passes import first_moment
from footscan.cloud.points import stripe_step
from footscan.mesh.mesh import Mesh
from footscan.mesh.topology import vertex_normals
from footscan.side_by_side import cores
from footscan.surface.errors.ends import beyond_stripes, find_ends
from footscan.surface.errors.evidence import Evidence
from footscan.surface.errors.field import REACH_MM, WIDE_MM, ErrorField, broad_and_narrow
from footscan.surface.errors.measured import USUAL_STEP_MM, around, between_stripes, measured_noise, systematic
from schemas.movement import MovementReport

Floats = NDArray[np.float64]

ERROR_GROWS = 0.04
"""Growth of the standard deviation per mm into filled surface. Tuned on feet of the virtual scanner."""
COMMON_MM = 0.01
"""Standard deviation that a whole part of the foot, as broad as `WIDE_MM`, has in common: stripes and surfaces that are
a little too far in make a girth too small all around. Tuned on 40 scanners without pictures (`draw_assembled`, seeds
4514 to 4553), whose girths at waist and instep are 0.06 mm too small."""
FACING_GROWS = 0.15
"""Growth of the standard deviation per mm into filled surface that faces the travel, as the tips of the shorter toes
do: root mean square 0.16 per mm on 16 calibrated scanners (`draw_assembled`, seeds 1001 to 1016)."""
END_GROWS = 0.08
"""Growth of the standard deviation per mm along the travel beyond the outermost stripe, at heel and toes: some 0.06 of
heels and 0.1 of toes on 50 scans of virtual feet (`draw_assembled`)."""
WHOLE, PATCHY = 0.5, 1.0
"""Errors of an end that it has as a whole, and those that vary over `REACH_MM`, relative to the standard deviation of
its place. Few points of another laser bend a part of a heel, and turn the axis of the foot: tuned on `draw_assembled`,
seed 4134, where they turned it by 1.3 degrees."""
OF_DISAGREEMENT = 0.5
"""Errors of the mean of all cameras, relative to their systematic disagreement, and as broad as a camera's view. Tuned
on 80 films (`draw_assembled`, seeds 3559 to 3598 and 4000 to 4039). In six others (2503, 2506, 2604, 3516, 3568 and
3582) the surface errs by 0.1 to 1.0 of the disagreement where cameras agree (root mean square)."""
UNSEEN_SWAY_MM = 0.12
"""Standard deviation of slow movement of the foot, along X and across, where heads do not show it, since none film the
same skin, or all film it at the same moment: the root mean square of feet that sway with amplitudes of up to 0.3 mm.
Chosen by hand, after `draw_moving`, seeds 7413 and 7442."""
FORM_MM, OF_TREMOR = 0.03, 2.0
"""Tremor that the form of a still foot looks like, and errors of X relative to what exceeds it where the foot was not
moved back: heads that jitter also ripple, which no stripe shows. Chosen by hand: ideal scanners (`draw_assembled`,
seeds 701 to 703, as designed) look like a tremor of 0.03 mm, those whose heads jitter and ripple by 0.2 mm like one of
0.08."""
LEFT_OF_TREMOR = 0.2
"""Share of a tremor that is left when the foot was moved back: 0.1 to 0.15 on the feet that `movement` was tuned on."""
RELIABLE_MM = 5.0
"""Filled surface nearer than this to measured surface counts as measured: a smooth surface hardly errs there. Chosen by
hand."""


class ScanErrors(NamedTuple):
    """The errors of a scanned surface of V vertices."""

    fields: list[ErrorField]
    """Independent of each other"""
    is_unseen: NDArray[np.bool_]
    """(V,) far from measured surface, or an end that one camera alone saw"""

    @property
    def deviations(self) -> Floats:
        """(V,) standard deviations from all causes along the normals, mm: their root sum of squares."""
        return np.asarray(np.sqrt(sum(field.deviations**2 for field in self.fields)))


def scan_errors(mesh: Mesh, evidence: Evidence) -> ScanErrors:
    """Estimate the errors of a scanned surface.

    `mesh` : mm, scanner frame; without `filled`, all vertices count as measured
    """
    vertices, cloud = mesh.vertices, evidence.cloud
    normals = vertex_normals(vertices, mesh.faces)
    seen = np.ones(len(vertices), bool) if mesh.filled is None else ~mesh.filled
    step_mm = USUAL_STEP_MM if cloud is None else stripe_step(cloud) or USUAL_STEP_MM
    beyond_mm = beyond_stripes(vertices, ~seen, cloud, step_mm)
    gap_mm = np.maximum(beyond_mm, 0.0)
    inside = ~seen & (beyond_mm <= 0)
    gap_mm[inside] = KDTree(vertices[seen]).query(vertices[inside], workers=cores())[0]
    points, scatter_mm = around(vertices, normals, cloud)
    everywhere = np.ones(len(vertices))
    # Heads pass the same skin at different times, and what one saw moves against what another one saw.
    filmed_mm = vertices[:, 0] if points is None else _moments(points, evidence.movement) * step_mm
    ends = find_ends(vertices, evidence)
    shift_mm = np.max([np.zeros(len(vertices)), *(end.shift_at(vertices[:, 0], step_mm) for end in ends)], axis=0)
    fields = [
        *broad_and_narrow("noise", measured_noise(points, scatter_mm, evidence.agreement, step_mm)),
        ErrorField("noise", everywhere * COMMON_MM, WIDE_MM),
        ErrorField("noise", between_stripes(vertices, normals, points, evidence), WIDE_MM),
        ErrorField("filling", np.where(inside, ERROR_GROWS * gap_mm, 0.0), REACH_MM),
        *broad_and_narrow("filling", np.where(inside, FACING_GROWS * gap_mm * np.abs(normals[:, 0]), 0.0)),
        *broad_and_narrow("ends", END_GROWS * np.maximum(beyond_mm, 0.0)),
        ErrorField("ends", WHOLE * shift_mm * normals[:, 0], WIDE_MM, vertices[:, 0]),
        ErrorField("ends", PATCHY * shift_mm, REACH_MM),
        ErrorField("cameras", everywhere * OF_DISAGREEMENT * systematic(points, evidence.agreement), WIDE_MM),
        ErrorField("tremor", _moved_mm(evidence.movement) * normals[:, 0], REACH_MM, filmed_mm),
        *(
            ErrorField("sway", size_mm * normals[:, axis], PACES_BETWEEN * pace * step_mm, filmed_mm)
            for axis, (size_mm, pace) in enumerate(_sway(evidence.movement, filmed_mm / step_mm))
        ),
    ]
    return ScanErrors(fields, np.any([gap_mm > RELIABLE_MM, *(end.is_unseen(vertices[:, 0]) for end in ends)], axis=0))


def _moments(points: NDArray[np.void], movement: MovementReport | None) -> Floats:
    """(V,) moments at which skin was filmed, by the points (V, K) around it, the nearest first."""
    of_nearest = first_moment(points[:, 0], {} if movement is None else movement.first_moments)
    return np.asarray(points["frame"].mean(axis=1) + of_nearest)


def _moved_mm(movement: MovementReport | None) -> float:
    """Standard deviation of the X of a stripe, mm."""
    if movement is None:
        return 0.0
    if movement.x_mm:
        return LEFT_OF_TREMOR * movement.tremor_mm
    return max(movement.tremor_mm, OF_TREMOR * math.sqrt(max(movement.tremor_mm**2 - FORM_MM**2, 0.0)))


def _sway(movement: MovementReport | None, filmed: Floats) -> tuple[tuple[Floats | float, float], ...]:
    """Standard deviations, mm, at the frames `filmed` (V,), and pace in frames, of the slow movement along X and Y."""
    if movement is None or movement.sway_by_axis_mm is None:
        return ((UNSEEN_SWAY_MM, PACE_FRAMES),) * 2
    x, y = movement.sway_by_axis_mm
    left_x, left_y, left_y_frames = movement.left_x_mm, movement.left_y_mm, movement.left_y_frames
    return (
        (x if left_x is None else left_x, PACE_FRAMES),
        (np.interp(filmed, np.arange(len(left_y)), left_y) if left_y else y, left_y_frames or PACE_FRAMES),
    )

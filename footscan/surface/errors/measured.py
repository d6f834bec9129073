"""Errors of the measured part of a surface: from its points, their scatter, and cameras that contradict each other."""

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.lasers.apart import between_lasers
from footscan.cloud.points import coordinates
from footscan.mesh.nearest import tree_of
from footscan.side_by_side import cores
from footscan.surface.errors.evidence import Evidence
from schemas.fusion import FusionReport

Floats = NDArray[np.float64]

ERROR_MM = 0.006
"""Standard deviation of a measured vertex. Tuned on eight scanners without pictures whose feet have edges of 1 mm
(`draw_assembled`, seeds 4514 to 4521), and on ten films (5401 to 5410)."""
USUAL_SCATTER_MM = 0.015
"""Mean distance of points from the surface that says nothing of its errors. Tuned on feet of the virtual
scanner."""
USUAL_STEP_MM = 2.0
"""Distance of stripes at which both hold. Of distant stripes both grow as the sagitta of the skin between two, with the
square of their distance; that of 2 mm is about `USUAL_SCATTER_MM`."""
NEAREST, SHARED = 4, 0.1
"""Points nearest to a vertex, and the part of their standard deviation that all points around it share. Tuned as
`ERROR_MM`."""
SCATTERED, OF_SCATTER, SCATTER_STEP_MM = 16, 2.0, 4.0
"""Points nearest to a vertex whose scatter off the surface is judged; errors of the surface relative to what exceeds
the scatter of all vertices; and the distance of stripes beyond which the mesh is too coarse to follow its points, which
then say nothing. Where a camera takes two lasers for one, its points contradict each other, and the surface follows
them half the way. Tuned on films of `draw_assembled`, seeds 2503, 2513 and 2604. In the first two the root mean square
of the errors is 0.04 mm where points are off by less than 0.01 mm, 0.12 to 0.18 by 0.05, and 0.16 to 0.22 by 0.12."""
OF_GROSS = 2.0
"""Standard deviation of a vertex whose points one camera alone saw, relative to the gross errors of cameras that see
the same skin. Tuned on films of `draw_assembled`, seeds 2503, 2506, 2604, 3516, 3582, 3584 and 3590: such skin errs by
1.1 to 3.6 of them (root mean square)."""
OF_BETWEEN, OF_CONFIRMED, BETWEEN_MM = 0.12, 0.4, (2.0, 3.0)
"""Standard deviation of a vertex relative to the distance of two lasers that light it: cameras see both stripes as one,
which lies between them, all over the skin that both light. Where two cameras agree it is less by the second number. It
falls to 0 from the first to the second distance, where a valley parts them. Tuned on 58 films (`draw_assembled`, seeds
2681 to 2720 and 3501 to 3518): where the upper lasers are 0.6 to 2 mm apart, the height of the big toe errs by 0.41 mm
(root mean square), up to 2.6 mm by 0.18, and beyond by 0.13; and on nine films (5401 to 5410 but for 5406): skin of the
instep whose lasers are 0.6 to 2.5 mm apart errs by 0.17 to 0.24 mm where one camera sees it, and by 0.05 to 0.10 where
two agree."""
LIT_MM = (6.0, 20.0)
"""A laser lights the skin around the points of its head up to the first distance; the second holds for skin that one
camera alone saw. Over the instep a laser lights more than its own cameras see, and a camera of the other head takes its
stripe for its own. The first chosen by hand, the second tuned on nine films (`draw_assembled`, seeds 5401 to 5410 but
for 5406)."""
ASKED, BESIDE, BESIDE_MM = 16, 2.0, 0.2
"""Points around a vertex of which it is asked whether their camera sees two stripes; how far the second one may lie,
relative to the distance of the lasers; and beyond that, mm. Lines of sight slope by up to 60 degrees from the normals
of the lasers' planes. Skin that faces the travel parts the stripes by more. Chosen by hand."""
LEAST_SINE = 0.2
"""Least sine of the angle between the normal of such skin and the travel: with less, any second stripe lies beside the
first one. Chosen by hand."""


def around(vertices: Floats, normals: Floats, cloud: NDArray[np.void] | None) -> tuple[NDArray[np.void] | None, Floats]:
    """Returns (V, NEAREST) the points of a cloud nearest to each vertex, and (V,) how far the points around it are
    off the surface on average, mm; None and 0 without enough points."""
    if cloud is None or len(cloud) < SCATTERED:
        return None, np.zeros(len(vertices))
    points = coordinates(cloud)
    vertex = np.asarray(tree_of(vertices).query(points, workers=cores())[1])
    off_mm = np.abs(((points - vertices[vertex]) * normals[vertex]).sum(axis=1))
    near = np.asarray(tree_of(points).query(vertices, SCATTERED, workers=cores())[1])
    return cloud.take(near[:, :NEAREST]), off_mm[near].mean(axis=1)


def measured_noise(
    points: NDArray[np.void] | None, scatter_mm: Floats, agreement: FusionReport | None, step_mm: float
) -> Floats:
    """Return (V,) the standard deviations of vertices, mm: by the points around them, by how far these scatter, or,
    where one camera alone saw them, by the gross errors of others, whichever is largest.

    `points`, `scatter_mm` : as of `around`
    """
    sagitta_mm = USUAL_SCATTER_MM * max((step_mm / USUAL_STEP_MM) ** 2 - 1.0, 0.0)
    excess_mm = np.maximum(scatter_mm - USUAL_SCATTER_MM - sagitta_mm, 0.0)
    noise = np.maximum(ERROR_MM + sagitta_mm, OF_SCATTER * excess_mm * (step_mm <= SCATTER_STEP_MM))
    if points is not None:
        noise = np.maximum(noise, SHARED * points["sigma"].mean(axis=1))
        if agreement is not None:
            noise = np.maximum(noise, OF_GROSS * agreement.gross_mm * _seen_alone(points))
    return np.asarray(noise)


def _seen_alone(points: NDArray[np.void]) -> Floats:
    """Returns (V,) the share of the `points` around each vertex that one camera alone saw."""
    return np.asarray((points["cameras"] == 1).mean(axis=1))


def between_stripes(vertices: Floats, normals: Floats, points: NDArray[np.void] | None, evidence: Evidence) -> Floats:
    """Return (V,) the standard deviations of vertices where two lasers are so close that cameras see one stripe, mm.

    `points` : as of `around`
    """
    if evidence.cloud is None or evidence.agreement is None:
        return np.zeros(len(vertices))
    alone = 1.0 if points is None else _seen_alone(points)
    lit_mm = LIT_MM[0] + (LIT_MM[1] - LIT_MM[0]) * alone
    apart = between_lasers(evidence.lasers, vertices, evidence.cloud, evidence.agreement.heads, lit_mm)
    near, far = BETWEEN_MM
    apart = np.minimum(apart, far)
    merged = OF_BETWEEN * apart * np.minimum((far - apart) / (far - near), 1.0)
    merged *= alone + OF_CONFIRMED * (1.0 - alone)
    doubtful = np.flatnonzero(merged)
    facing = np.abs(normals[doubtful, 0])
    slope = facing / np.sqrt(np.maximum(1.0 - facing**2, LEAST_SINE**2))
    beside_mm = (BESIDE + slope) * apart[doubtful] + BESIDE_MM
    merged[doubtful] *= 1.0 - _parted(vertices[doubtful], beside_mm, evidence.seen, evidence.parted_mm)
    return merged


def _parted(
    places: Floats, beside_mm: Floats, seen: NDArray[np.void], parted_mm: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Return (V,) the share of the points around each place (V, 3), mm, whose camera sees a second stripe within
    `beside_mm` (V,) of their own: these are two stripes.

    `seen`, `parted_mm` : as of `Evidence`
    """
    if len(seen) < ASKED or not len(places):
        return np.zeros(len(places))
    near = np.asarray(tree_of(coordinates(seen)).query(places, ASKED, workers=cores())[1])
    return np.asarray(np.mean(parted_mm[near] <= beside_mm[:, None], axis=1))


def systematic(points: NDArray[np.void] | None, agreement: FusionReport | None) -> Floats | float:
    """Return (V,) the systematic disagreement of the cameras of the `points` around each vertex, mm; one for all
    without points."""
    if agreement is None:
        return 0.0
    if points is None:
        return agreement.systematic_mm
    cameras, number = np.unique(points["camera"], return_inverse=True)
    apart = np.array([agreement.systematic_of(int(camera)) for camera in cameras])
    return np.asarray(apart[number.reshape(points.shape)].mean(axis=1))

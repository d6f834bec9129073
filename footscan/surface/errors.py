"""Errors of the surface of a scan: standard deviations of its vertices, one field a cause."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array
from scipy.spatial import KDTree

from footscan.cloud.lasers.apart import UNKNOWN, between_lasers, planes_apart
from footscan.cloud.outliers.contested import FEWEST_AT_END, LEG_MM, NOT_CONTESTED, ends_of
from footscan.cloud.points import coordinates, stripe_step
from footscan.compiled import compiled
from footscan.mesh.mesh import Mesh
from footscan.mesh.topology import vertex_normals
from schemas.fusion import FusionReport
from schemas.measures import ErrorCause
from schemas.movement import MovementReport

Floats = NDArray[np.float64]

ERROR_MM, ERROR_GROWS, REACH_MM = 0.015, 0.04, 10.0
"""Standard deviation of a measured vertex, its growth per mm into filled surface, and the distance over which vertices
share their error. Tuned on virtual feet: docs/surface.md."""
COMMON_MM = 0.015
"""Standard deviation that a whole part of the foot, as broad as `WIDE_MM`, has in common: stripes and surfaces that are
a little too far in make a girth too small all around. Tuned on ideal scanners (`draw_assembled`, seeds 701 and 702, as
designed), whose girths at waist and instep are 0.13 to 0.18 mm too small."""
NARROW_MM = 3.0
"""The smaller distance over which vertices share noise, and what is filled at the ends: the tip of a toe moves to its
side if one half of its cap errs. Chosen by hand, after scanners (`draw_assembled`, seeds 805 and 806) whose axes
through the second toe were off by 0.4 degrees."""
USUAL_STEP_MM = 2.0
"""Distance of stripes at which that holds. It grows with the square of a longer one, as the sagitta of the skin between
two stripes does."""
NEAREST, SHARED = 4, 0.25
"""Points nearest to a vertex, and the part of their standard deviation that all points around it share. Tuned on
scanners without pictures whose planes a body has shown: `draw_assembled`, seeds 801 to 810."""
SCATTERED, OF_SCATTER, SCATTER_STEP_MM = 16, 2.5, 4.0
"""Points nearest to a vertex whose scatter off the surface is judged; errors of the surface relative to what exceeds
the scatter of all vertices; and the distance of stripes beyond which the mesh is too coarse to follow its points, which
then say nothing. Where a camera takes two lasers for one, its points contradict each other, and the surface follows
them half the way. Tuned on films of `draw_assembled`, seeds 2503, 2513 and 2604. In the first two the root mean square
of the errors is 0.04 mm where points are off by less than 0.01 mm, 0.12 to 0.18 by 0.05, and 0.16 to 0.22 by 0.12."""
OF_BETWEEN, BETWEEN_MM = 0.15, (2.0, 3.0)
"""Standard deviation of a vertex relative to the distance of two lasers that light it: cameras see both stripes as one,
which lies between them, all over the skin that both light. It falls to 0 from the first to the second distance, where a
valley parts them. Tuned on 58 films (`draw_assembled`, seeds 2681 to 2720 and 3501 to 3518): where the upper lasers are
0.6 to 2 mm apart, the height of the big toe errs by 0.41 mm (root mean square), up to 2.6 mm by 0.18, and beyond by
0.13."""
FACING_GROWS = 0.15
"""Growth of the standard deviation per mm into filled surface that faces the travel, as the tips of the shorter toes
do: root mean square 0.16 per mm on 16 calibrated scanners (`draw_assembled`, seeds 1001 to 1016)."""
END_GROWS = 0.08
"""Growth of the standard deviation per mm along the travel beyond the outermost stripe, at heel and toes: some 0.06 of
heels and 0.1 of toes on 50 scans of virtual feet (`draw_assembled`)."""
SHORT_GROWS = 2.0
"""Growth of the standard deviation per mm by which the surface falls short of the outermost stripe. Chosen by hand,
after two scans with 4 mm between stripes (`draw_assembled`, seeds 701 and 702, as designed): ends 0.3 to 0.5 mm short
of the stripe are 0.6 to 0.8 mm short of the foot."""
ALONE_GROWS, DROPPED_GROWS, ALONE_MM = 0.35, 0.5, 2.0
"""Growth of the standard deviation per mm along the travel beyond the last place where two cameras agree: one camera
alone may take the stripe of another head's laser for its own. The second growth holds up to stripes beyond an end that
were dropped: the foot may reach as far. An end that reaches farther than the third, a step of the travel, counts as
filled, and nearer it is worth less doubt: stripes of heads that are apart end at different places. Chosen by hand,
after a filmed scanner (`draw_assembled`, seed 501) whose heel began too early, and seeds 901 to 940 and 961 to 978
without pictures, whose lengths were right to 0.4 mm but for two."""
ASIDE = 0.1
"""Errors of an end that vary over `NARROW_MM`, relative to those along the travel that it has as a whole. Chosen by
hand, after `draw_assembled`, seeds 971 to 978."""
LEAST_CONFIRMED = 0.2
"""Share of the points on which cameras must agree for the ends to be confirmed. Chosen by hand."""
OF_DISAGREEMENT = 1.5
"""Errors of the mean of all cameras, relative to their systematic disagreement, and as broad as a camera's view: each
camera errs, and what all of them have in common does not show. Tuned on `draw_assembled`, seeds 801 to 810 without
pictures, 511 and 512 with films, and `draw_world`, seeds 6001 to 6024."""
SWAY_MM, SWAY_STEPS = 0.07, 12.0
"""Standard deviation of slow movement of the foot, along X and across, where nothing is known of it, as in
`footscan.cloud.movement.sway`; and the steps of the travel over which it varies. Over a tenth of a metre it looks like
the form of another foot. Chosen by hand, the second one for a sway of 0.7 Hz, which turns over in 13 frames."""
FORM_MM, OF_TREMOR = 0.03, 2.0
"""Tremor that the form of a still foot looks like, and errors of X relative to what exceeds it where the foot was not
moved back: heads that jitter also ripple, which no stripe shows. Chosen by hand: ideal scanners (`draw_assembled`,
seeds 701 to 703, as designed) look like a tremor of 0.03 mm, those whose heads jitter and ripple by 0.2 mm like one of
0.08."""
LEFT_OF_TREMOR = 0.2
"""Share of a tremor that is left when the foot was moved back: 0.1 to 0.15 on the feet that `movement` was tuned on."""
WIDE_MM = 60.0
"""Distance over which errors of whole cameras and heads vary on the foot. Chosen by hand."""

RELIABLE_MM = 5.0
"""Filled surface nearer than this to measured surface counts as measured: a smooth surface hardly errs there. Chosen by
hand."""


class ErrorField(NamedTuple):
    """Errors of the vertices that have one cause."""

    cause: ErrorCause
    deviations: Floats
    """(V,) standard deviations of the displacement along the normal, mm; of vertices that share an error, with the sign
    in which it displaces each"""
    reach_mm: float = 0.0
    """Distance over which vertices share their error; 0: each has its own."""
    is_of_section: bool = False
    """True if all vertices at about the same X share it, as where the whole foot moved while it was scanned"""

    @property
    def places(self) -> tuple[float, bool]:
        """What `shares` depend on."""
        return self.reach_mm, self.is_of_section

    def shares(self, vertices: Floats) -> csr_array:
        """(V, N) shares of N independent standard normal errors in that of each vertex, in its standard deviations.

        `vertices` : (V, 3) mm
        """
        if not self.reach_mm:
            return csr_array(eye_array(len(vertices)))
        return _shares(vertices[:, :1] if self.is_of_section else vertices, self.reach_mm)

    def of(self, source: NDArray[np.intp]) -> "ErrorField":
        """The errors of W other vertices; source : (W,) index of the vertex that each of them was."""
        return self._replace(deviations=self.deviations[source])


def _shares(places: Floats, reach_mm: float) -> csr_array:
    """(V, N) linear interpolation at `places` (V, D) between errors at the N nodes of a grid, of unit variance."""
    cells = places / reach_mm
    cells -= np.floor(cells.min(axis=0))
    size = cells.max(axis=0).astype(np.int64) + 2
    columns, weights, count = _corners_of_cells(cells, size)
    starts = np.arange(len(places) + 1) * columns.shape[1]
    return csr_array((weights.ravel(), columns.ravel(), starts), shape=(len(places), count))


@compiled
def _corners_of_cells(cells: Floats, size: NDArray[np.int64]) -> tuple[NDArray[np.int64], Floats, int]:
    """Returns (V, 2^D) the corners of each place's cell, numbered without gaps in the order of the grid, (V, 2^D) their
    weights and the number of all corners.

    cells : (V, D) places in a grid of `size` (D,) nodes
    """
    dimensions = len(size)
    corners = 2**dimensions
    node, weight = np.empty((len(cells), corners), np.int64), np.empty((len(cells), corners))
    number = np.zeros(np.prod(size), np.int64)
    for k in range(len(cells)):
        squares = 0.0
        for corner in range(corners):
            place, share = 0, 1.0
            for axis in range(dimensions):
                low = int(cells[k, axis])
                part, ahead = cells[k, axis] - low, (corner >> (dimensions - 1 - axis)) & 1
                place = place * size[axis] + low + ahead
                share *= part if ahead else 1.0 - part
            node[k, corner], weight[k, corner] = place, share
            number[place] = 1
            squares += share * share
        weight[k] /= np.sqrt(squares)
    number = np.cumsum(number) - 1
    for k in range(len(cells)):
        for corner in range(corners):
            node[k, corner] = number[node[k, corner]]
    return node, weight, number[-1] + 1


class Evidence(NamedTuple):
    """What a scan shows of its own errors."""

    cloud: NDArray[np.void] | None = None
    """(N,) of `POINT_DTYPE`, fused: how sure each place is, and where one camera alone saw the ends"""
    agreement: FusionReport | None = None
    """Of the cameras; None: exact"""
    movement: MovementReport | None = None
    """Of the foot; None: it stood still"""
    lasers: Floats = UNKNOWN
    """(L, 6) as of `lasers_of`: one camera alone may see an end too far out by the largest distance of two"""
    contested_mm: tuple[float, float] = NOT_CONTESTED
    """Least and greatest X of the foot with stripes that were dropped for contradicting other cameras"""
    tip_doubts_mm: tuple[float, float] = (0.0, 0.0)
    """Standard deviation of the X of heel and toes, where they lie beyond the stripes"""


NO_EVIDENCE = Evidence()
"""That of a scan of which the surface alone is known."""


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
    beyond_mm = _beyond(vertices, ~seen, cloud, step_mm)
    gap_mm = np.maximum(beyond_mm, 0.0)
    inside = ~seen & (beyond_mm <= 0)
    gap_mm[inside] = KDTree(vertices[seen]).query(vertices[inside])[0]
    around, scatter_mm = _around(vertices, normals, cloud)
    everywhere = np.ones(len(vertices))
    sway_mm = (evidence.movement and evidence.movement.sway_by_axis_mm) or (SWAY_MM, SWAY_MM)
    ends = _ends(vertices, evidence)
    shift_mm = np.max([np.zeros(len(vertices)), *(end.shift_at(vertices[:, 0], step_mm) for end in ends)], axis=0)
    fields = [
        *_broad_and_narrow("noise", np.maximum(_noise(around, step_mm), _scattered(scatter_mm, step_mm))),
        ErrorField("noise", everywhere * COMMON_MM, WIDE_MM),
        ErrorField("noise", _between_stripes(vertices, evidence), WIDE_MM),
        ErrorField("filling", np.where(inside, ERROR_GROWS * gap_mm, 0.0), REACH_MM),
        *_broad_and_narrow("filling", np.where(inside, FACING_GROWS * gap_mm * np.abs(normals[:, 0]), 0.0)),
        *_broad_and_narrow("ends", END_GROWS * np.maximum(beyond_mm, 0.0)),
        ErrorField("ends", shift_mm * normals[:, 0], WIDE_MM, is_of_section=True),
        ErrorField("ends", ASIDE * shift_mm, NARROW_MM),
        ErrorField("cameras", everywhere * OF_DISAGREEMENT * _apart(around, evidence.agreement), WIDE_MM),
        ErrorField("tremor", _moved_mm(evidence.movement) * normals[:, 0], REACH_MM, is_of_section=True),
        *(
            ErrorField("sway", sway_mm[axis] * normals[:, axis], SWAY_STEPS * step_mm, is_of_section=True)
            for axis in (0, 1)
        ),
    ]
    is_alone = [end.depth(vertices[:, 0], end.unsure_mm) > ALONE_MM for end in ends]
    return ScanErrors(fields, np.any([gap_mm > RELIABLE_MM, *is_alone], axis=0))


def _broad_and_narrow(cause: ErrorCause, deviations: Floats) -> list[ErrorField]:
    """Errors (V,) of which half the variance is shared by vertices far from each other, and half by near ones only."""
    return [ErrorField(cause, math.sqrt(0.5) * deviations, reach_mm) for reach_mm in (REACH_MM, NARROW_MM)]


class _End(NamedTuple):
    """Heel or toes."""

    x: float
    """Of the outermost vertex below the leg, mm"""
    alone_mm: float = 0.0
    """How far beyond the last place where two cameras agree one camera alone saw it"""
    dropped_mm: float = 0.0
    """How far beyond the surface stripes were dropped"""
    short_mm: float = 0.0
    """How far the surface falls short of the outermost stripe"""
    tip_mm: float = 0.0
    """Standard deviation of its place beyond the outermost stripe, along the travel"""

    @property
    def unsure_mm(self) -> float:
        """Length of the part along the travel that no second camera confirms."""
        return self.alone_mm + self.dropped_mm

    @property
    def shift_mm(self) -> float:
        """Standard deviation of its place along the travel.

        >>> [round(_End(0.0, alone_mm).shift_mm, 3) for alone_mm in (0.0, 0.5, 1.0, 2.0, 3.0)]
        [0.0, 0.044, 0.175, 0.7, 1.05]
        """
        unsure_mm = ALONE_GROWS * self.alone_mm + DROPPED_GROWS * self.dropped_mm
        seen_mm = unsure_mm * min(self.unsure_mm / ALONE_MM, 1.0) + SHORT_GROWS * self.short_mm
        return math.hypot(seen_mm, self.tip_mm)

    def depth(self, x: Floats, most_mm: float) -> Floats:
        """(V,) how far vertices at `x` (V,) mm lie beyond the place `most_mm` within the end, mm."""
        return np.asarray(np.clip(most_mm - np.abs(x - self.x), 0.0, None))

    def shift_at(self, x: Floats, step_mm: float) -> Floats:
        """(V,) standard deviations that vertices at `x` (V,) mm have in common with the end, along the travel, mm.

        They fall to 0 within the part that no second camera confirms, at least within one step of the travel.
        """
        falls_mm = max(self.unsure_mm, step_mm)
        return self.shift_mm * self.depth(x, falls_mm) / falls_mm


def _ends(vertices: Floats, evidence: Evidence) -> list[_End]:
    """Find heel and toes, and what is not known of them; nothing of a body without a low part."""
    low, cloud = vertices[vertices[:, 2] < LEG_MM, 0], evidence.cloud
    stripes = np.zeros(0) if cloud is None else cloud["x"][cloud["z"] < LEG_MM]
    if cloud is None or len(stripes) < FEWEST_AT_END or not len(low):
        return []
    surface, outermost, confirmed = (low.min(), low.max()), ends_of(stripes), confirmed_ends(cloud)
    farthest, ends = planes_apart(evidence.lasers, outermost), []
    for side, outward in enumerate((-1.0, 1.0)):
        alone = 0.0 if confirmed is None else outward * (outermost[side] - confirmed[side])
        dropped, short = (outward * (seen[side] - surface[side]) for seen in (evidence.contested_mm, outermost))
        alone = min(alone, farthest)
        unsure = float(alone), max(float(dropped), 0.0), max(float(short), 0.0)
        ends.append(_End(float(surface[side]), *unsure, evidence.tip_doubts_mm[side]))
    return ends


def _around(
    vertices: Floats, normals: Floats, cloud: NDArray[np.void] | None
) -> tuple[NDArray[np.void] | None, Floats]:
    """Returns (V, NEAREST) the points of a cloud nearest to each vertex, and (V,) how far the points around it are
    off the surface on average, mm; None and 0 without enough points."""
    if cloud is None or len(cloud) < SCATTERED:
        return None, np.zeros(len(vertices))
    points = coordinates(cloud)
    vertex = np.asarray(KDTree(vertices).query(points)[1])
    off_mm = np.abs(((points - vertices[vertex]) * normals[vertex]).sum(axis=1))
    near = np.asarray(KDTree(points).query(vertices, SCATTERED)[1])
    return cloud[near[:, :NEAREST]], off_mm[near].mean(axis=1)


def _scattered(scatter_mm: Floats, step_mm: float) -> Floats:
    """(V,) standard deviations of vertices from the scatter of the points around them, mm."""
    return OF_SCATTER * np.maximum(scatter_mm - _least(step_mm), 0.0) * (step_mm <= SCATTER_STEP_MM)


def _least(step_mm: float) -> float:
    """Standard deviation of any vertex, and scatter of the points off the coarse mesh of distant stripes, mm."""
    return ERROR_MM * max(1.0, (step_mm / USUAL_STEP_MM) ** 2)


def _between_stripes(vertices: Floats, evidence: Evidence) -> Floats:
    """(V,) standard deviations of vertices where two lasers are so close that cameras see one stripe, mm."""
    if evidence.cloud is None or evidence.agreement is None:
        return np.zeros(len(vertices))
    apart = between_lasers(evidence.lasers, vertices, evidence.cloud, evidence.agreement.heads)
    near, far = BETWEEN_MM
    apart = np.minimum(apart, far)
    return OF_BETWEEN * apart * np.minimum((far - apart) / (far - near), 1.0)


def _noise(around: NDArray[np.void] | None, step_mm: float) -> Floats | float:
    """Return (V,) the standard deviations of vertices from the points around them, mm; one for all without points."""
    least = _least(step_mm)
    return least if around is None else np.asarray(np.maximum(least, SHARED * around["sigma"].mean(axis=1)))


def _apart(around: NDArray[np.void] | None, agreement: FusionReport | None) -> Floats | float:
    """Return (V,) the systematic disagreement of the cameras of the points around each vertex, mm; one for all without
    points."""
    if agreement is None:
        return 0.0
    if around is None:
        return agreement.systematic_mm
    cameras, number = np.unique(around["camera"], return_inverse=True)
    apart = np.array([agreement.systematic_of(int(camera)) for camera in cameras])
    return np.asarray(apart[number.reshape(around.shape)].mean(axis=1))


def _moved_mm(movement: MovementReport | None) -> float:
    """Standard deviation of the X of a stripe, mm."""
    if movement is None:
        return 0.0
    if movement.x_mm:
        return LEFT_OF_TREMOR * movement.tremor_mm
    return max(movement.tremor_mm, OF_TREMOR * math.sqrt(max(movement.tremor_mm**2 - FORM_MM**2, 0.0)))


def _beyond(
    vertices: NDArray[np.float64], filled: NDArray[np.bool_], cloud: NDArray[np.void] | None, step_mm: float
) -> NDArray[np.float64]:
    """Return (V,) how far each vertex lies beyond the outermost stripes along the travel, mm; 0 or less for most.

    Without a cloud it is measured from the outermost vertices that are not filled. The caps of heel and toes beyond the
    stripes are broad, but less than one step high. The outermost stripe may touch the foot beside its cap: filled
    surface less than one step from an end counts from the measured surface that is nearest.
    """
    x = vertices[:, 0]
    if cloud is not None and len(cloud) > 2 * FEWEST_AT_END:
        first, last = ends_of(cloud["x"])
    else:
        first, last = float(x[~filled].min()), float(x[~filled].max())
    beyond = np.maximum(first - x, x - last)
    cap = filled & (np.minimum(x - x.min(), x.max() - x) < step_mm)
    if cap.any() and not filled.all():
        nearest = KDTree(vertices[~filled]).query(vertices[cap])[1]
        beyond[cap] = np.maximum(beyond[cap], np.abs(x[cap] - x[~filled][nearest]))
    return np.asarray(beyond)


def confirmed_ends(cloud: NDArray[np.void]) -> tuple[float, float] | None:
    """Least and greatest X, mm, at which two cameras or more agree on a cloud; None if they hardly agree anywhere.

    Parameters
    ----------
    cloud : (N,) of `POINT_DTYPE`, fused
    """
    low = cloud[cloud["z"] < LEG_MM]
    confirmed = low["x"][low["cameras"] > 1]
    return ends_of(confirmed) if len(confirmed) >= max(FEWEST_AT_END, LEAST_CONFIRMED * len(low)) else None

"""The ends of a scanned foot, heel and toes, and how doubtful their place along the travel is."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.cloud.lasers.apart import planes_apart
from footscan.cloud.outliers.contested import FEWEST_AT_END, LEG_MM, ends_of
from footscan.surface.errors.evidence import Evidence

Floats = NDArray[np.float64]

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
LEAST_CONFIRMED = 0.2
"""Share of the points on which cameras must agree for the ends to be confirmed. Chosen by hand."""


class End(NamedTuple):
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

        >>> [round(End(0.0, alone_mm).shift_mm, 3) for alone_mm in (0.0, 0.5, 1.0, 2.0, 3.0)]
        [0.0, 0.044, 0.175, 0.7, 1.05]
        """
        unsure_mm = ALONE_GROWS * self.alone_mm + DROPPED_GROWS * self.dropped_mm
        seen_mm = unsure_mm * min(self.unsure_mm / ALONE_MM, 1.0) + SHORT_GROWS * self.short_mm
        return math.hypot(seen_mm, self.tip_mm)

    def depth(self, x: Floats, most_mm: float) -> Floats:
        """(V,) how far vertices at `x` (V,) mm lie beyond the place `most_mm` within the end, mm."""
        return np.asarray(np.clip(most_mm - np.abs(x - self.x), 0.0, None))

    def is_unseen(self, x: Floats) -> NDArray[np.bool_]:
        """(V,) True for vertices at `x` (V,) mm that count as filled: so much is not confirmed by a second camera."""
        return self.depth(x, self.unsure_mm) > ALONE_MM

    def shift_at(self, x: Floats, step_mm: float) -> Floats:
        """(V,) standard deviations that vertices at `x` (V,) mm have in common with the end, along the travel, mm.

        They fall to 0 within the part that no second camera confirms, at least within one step of the travel.
        """
        falls_mm = max(self.unsure_mm, step_mm)
        return self.shift_mm * self.depth(x, falls_mm) / falls_mm


def find_ends(vertices: Floats, evidence: Evidence) -> list[End]:
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
        ends.append(End(float(surface[side]), *unsure, evidence.tip_doubts_mm[side]))
    return ends


def beyond_stripes(
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

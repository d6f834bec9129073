"""The ends of the surface along the travel, at heel and toes, which no stripe meets squarely."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import PLANE_MM
from footscan.surface.tip import tip_beyond

BEHIND_MM = 0.3
"""A tip no farther than this behind the last stripe is lit by the edge of the laser sheet, or just by its middle. The
points are placed on the middle of the sheet nevertheless. Chosen by hand."""
BEFORE_MM = 0.5
"""The edge of the sheet lights a tip that the middle of the sheet misses by up to this distance; chosen by hand."""
LARGEST_SPOT = 0.25
"""A spot lit by the edge of the sheet is smaller than this share of the section one step before; chosen by hand."""
AROUND_MM = 8.0
"""A toe reaches at most this far to either side of its stripe one step before; the tip of the next toe lies farther
away. Chosen by hand."""
APART_MM = 2.5
"""Stripes of one plane with a larger gap between them in Y are of two toes; chosen by hand."""
FEWEST = 3
"""Least number of points of a section."""
NEAREST_STEPS = 0.01
"""Bounds the weight of a tip that lies nearly in the last stripe."""
SECTIONS = 4
"""Sections used: three locate the tip, and the outermost stripe is tested against them."""

LEAST_IN_PLANES = 0.8
"""Share of a cloud's points in planes of constant X from which its ends are judged by sections. Chosen by hand."""
STRAY = 10
"""Fewer points than this before all others are strays, and do not say where a scattered cloud ends. Chosen by hand."""

BROAD_MM = 12.0
"""Radius of curvature, upright, from which an end is broad: a heel, whose curvature the surface continues to a tenth of
a millimetre, and a quadric does not. It overshoots narrow tips, as of toes. Tuned on 34 scans of 28 virtual feet
(`draw_assembled`), steps of 2 and 4 mm: radii of 14 to 30 mm against 3 to 11 mm."""
ALONE = 0.15
"""Standard deviation of a tip that the surface alone predicts, in mm per mm. Chosen by hand: where it predicted heels
0.5 to 2 mm beyond the last stripe and a quadric contradicted it (`draw_assembled`, seeds 4514, 4518, 5401 and 5405),
lengths erred by 0.01 to 0.06 mm."""
DEPTH_STEPS, EXTENT = 1.5, (0.02, 0.98)
"""Depth of the end at which that radius is taken, and the quantiles of Z there. Chosen by hand."""

Floats = NDArray[np.float64]
Numbers = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class TravelEnd:
    """One end of the travel; all X in mm."""

    outward: int
    """-1 where the travel starts, 1 at its end."""
    last_mm: float
    """X of the outermost stripe that is a section of the surface."""
    least_mm: float
    """Least distance of the tip beyond that stripe."""
    most_mm: float
    """Largest distance of the tip beyond that stripe."""
    tip_mm: float | None
    """Distance of the tip beyond that stripe as the sections predict it; None where there are too few of them."""
    is_broad: bool = False
    """True of a heel whose points are scattered: `tip_mm` says less of it than its surface."""

    @property
    def limit(self) -> float:
        """X beyond which there is no surface."""
        return self.last_mm + self.outward * self.most_mm

    def reached_mm(self, vertices: Floats) -> float:
        """How far vertices (V, 3) reach beyond the last stripe, mm; less than 0 if they do not."""
        return float((self.outward * (vertices[:, 0] - self.last_mm)).max())

    def tip_from(self, reached_mm: float) -> float:
        """Distance of the tip beyond the last stripe, mm, of a surface that reaches so far by itself."""
        by_sections = self._by_sections_mm
        tip = reached_mm if by_sections is None else (reached_mm + by_sections) / 2
        return self._within(tip)

    def doubt_mm(self, reached_mm: float) -> float:
        """Standard deviation of that, mm: how far the two predictions are from it, or what the surface alone is worth.

        >>> TravelEnd(1, 0.0, 0.0, 2.0, tip_mm=0.4).doubt_mm(1.4)
        0.5
        """
        if reached_mm <= 0.0:
            return 0.0
        by_sections = self._by_sections_mm
        if by_sections is None:
            return ALONE * reached_mm
        tip = self.tip_from(reached_mm)
        return max(abs(reached_mm - tip), abs(by_sections - tip))

    @property
    def _by_sections_mm(self) -> float | None:
        """Distance of the tip beyond the last stripe by the sections, mm; None where they say less than the surface."""
        return None if self.tip_mm is None or self.is_broad else self._within(self.tip_mm)

    def _within(self, tip_mm: float) -> float:
        return float(np.clip(tip_mm, self.least_mm, self.most_mm))


def travel_ends(points: Floats, step_mm: float) -> tuple[Mask, tuple[TravelEnd, TravelEnd]]:
    """Find the points of a cloud that only graze a tip, and where the surface ends.

    The squared extents in Y and in Z of the sections of an ellipsoid or a paraboloid at even distances lie on a
    parabola that does not bend up. The tip is where the parabola falls to zero. The tip lies less than one step beyond
    the last stripe, since there would be another stripe otherwise. Where the tip lies about in the plane of the last
    stripe, that stripe is no section: the edge of the sheet lights a spot, whose points are placed in the middle of
    the sheet. A spot is recognised by its size: it is no larger than the section of such a tip, or it is small and the
    sections before predict such a tip.

    Parameters
    ----------
    points : (N, 3) float64, mm, scanner frame; where they do not lie in stripe planes of constant X, the tip is that
        of a quadric, see `tip_beyond`
    step_mm : distance from one stripe plane to the next

    Returns
    -------
    grazing : (N,) true for the points of such spots
    ends : the end at the least X and the end at the greatest X

    Examples
    --------
    Stripes 1 mm apart over a sphere of radius 5 mm, the last of them half a millimetre before its tips:

    >>> angles = np.linspace(0, 2 * np.pi, 100)
    >>> ring = np.column_stack([np.zeros(100), np.cos(angles), np.sin(angles)])
    >>> stripes = [[x, 0, 0] + np.sqrt(25 - x**2) * ring for x in np.arange(-4.5, 5)]
    >>> grazing, ends = travel_ends(np.concatenate(stripes), step_mm=1.0)
    >>> [f"{end.last_mm:.1f} {end.tip_mm:.2f}" for end in ends]
    ['-4.5 0.50', '4.5 0.50']
    >>> int(grazing.sum())
    0
    """
    grazing = np.zeros(len(points), np.bool_)
    if not _in_planes(points, step_mm):
        return grazing, (_scattered_end(points, -1, step_mm), _scattered_end(points, 1, step_mm))
    ends = []
    for outermost, outward in ((points[:, 0].min(), -1), (points[:, 0].max(), 1)):
        tips, spots = list[float | None](), list[float | None]()
        for stripe in _stripes(points, np.abs(points[:, 0] - outermost) < PLANE_MM):
            squares = _sections(points, stripe, -outward * step_mm)
            predicted = _steps_to_tip(squares[1:])
            if _is_spot(squares, predicted, step_mm):
                grazing[stripe] = True
                spots.append(_mean(predicted))
            else:
                tips.append(_mean(_steps_to_tip(squares)))
        first = 0 if tips else 1
        predictions = [steps for steps in tips or spots if steps is not None]
        ends.append(
            TravelEnd(
                outward,
                last_mm=float(outermost - outward * first * step_mm),
                least_mm=first * (step_mm - BEFORE_MM),
                most_mm=step_mm + first * BEHIND_MM,
                tip_mm=max(predictions) * step_mm if predictions else None,
            )
        )
    return grazing, (ends[0], ends[1])


def _in_planes(points: Floats, step_mm: float) -> bool:
    """True if the points lie in planes of constant X at even distances."""
    steps = (points[:, 0] - points[:, 0].min()) / step_mm
    return bool(np.mean(np.abs(steps - np.rint(steps)) * step_mm < PLANE_MM) > LEAST_IN_PLANES)


def _scattered_end(points: Floats, outward: int, step_mm: float) -> TravelEnd:
    x = outward * points[:, 0]
    last = float(np.sort(x)[-min(STRAY, len(x))])
    tip_mm = tip_beyond(points[x <= last], outward)
    return TravelEnd(outward, outward * last, 0.0, step_mm, tip_mm, _is_broad(points, outward, step_mm))


def _is_broad(points: Floats, outward: int, step_mm: float) -> bool:
    """True if the end is broad: at depth d, a sphere of radius R is sqrt(8 d R) high."""
    x = outward * points[:, 0]
    depth = DEPTH_STEPS * step_mm
    z = points[x > np.sort(x)[-min(STRAY, len(x))] - depth, 2]
    height = float(np.ptp(np.quantile(z, EXTENT)))
    return height**2 / (8.0 * (depth + step_mm / 2)) > BROAD_MM


def drawn_to_tips(vertices: Floats, ends: tuple[TravelEnd, TravelEnd]) -> Floats:
    """Move the vertices beyond the last stripes along X so that the surface ends at the tips.

    The surface continues smoothly beyond a stripe, and its curvature there predicts the tip too. The sections predict
    it by how they shrink. The errors of the two predictions are independent, and their mean is taken; at a broad end
    without sections, the surface is left as it is.

    Parameters
    ----------
    vertices : (V, 3) float64, mm, scanner frame

    Returns
    -------
    (V, 3) float64, mm
    """
    moved = vertices.copy()
    for end in ends:
        reached = end.reached_mm(vertices)
        if reached <= 0.0:
            continue
        beyond = end.outward * (vertices[:, 0] - end.last_mm)
        change = end.tip_from(reached) - reached
        bend = max(change, -reached - change)  # a larger change would fold the surface over
        share = np.maximum(beyond / reached, 0.0)
        moved[:, 0] += end.outward * (bend * share**2 + (change - bend) * share)
    return moved


def _stripes(points: Floats, in_plane: Mask) -> list[Numbers]:
    """Numbers of the points of one plane, separated by toe."""
    numbers = np.flatnonzero(in_plane)
    numbers = numbers[np.argsort(points[numbers, 1], kind="stable")]
    return np.split(numbers, np.flatnonzero(np.diff(points[numbers, 1]) > APART_MM) + 1)


def _sections(points: Floats, stripe: Numbers, inward_mm: float) -> Floats:
    """Returns (N, 2) squared extents in Y and Z, mm², of a stripe and of the same tip in the planes before.

    There are at most `SECTIONS` of them.
    """
    extents = [np.ptp(points[stripe, 1:], axis=0)]
    while len(extents) < SECTIONS:
        low, high = points[stripe, 1].min(), points[stripe, 1].max()
        before = np.abs(points[:, 0] - points[stripe[0], 0] - inward_mm) < PLANE_MM
        before &= (points[:, 1] > low - AROUND_MM) & (points[:, 1] < high + AROUND_MM)
        own = [s for s in _stripes(points, before) if s.size and points[s[-1], 1] >= low and points[s[0], 1] <= high]
        if sum(s.size for s in own) < FEWEST:
            break
        stripe = np.concatenate(own)
        extents.append(np.ptp(points[stripe, 1:], axis=0))
    return np.array(extents) ** 2


def _steps_to_tip(squares: Floats) -> Floats:
    """Returns (K,) distances in steps from the first section to the tip, one for each of the two extents that shrinks.

    The distance is that at which a parabola through three sections, or a line through two, falls to zero. Where the
    parabola bends up, the third section includes a neighbouring toe, and the line through the other two is taken.
    """
    if len(squares) < 2:
        return np.empty(0)
    shrinking = squares[:, squares[1] > squares[0]]
    curvature = np.minimum((shrinking[2] - 2 * shrinking[1] + shrinking[0]) / 2, 0.0) if len(squares) > 2 else 0.0
    slope = shrinking[1] - shrinking[0] - curvature
    return np.asarray(2 * shrinking[0] / (slope + np.sqrt(slope**2 - 4 * curvature * shrinking[0])))


def _mean(steps: Floats) -> float | None:
    """Weighted mean of the predictions of both extents; a farther tip is less certain."""
    weights = 1.0 / np.maximum(steps, NEAREST_STEPS) ** 2
    return float(steps @ weights / weights.sum()) if steps.size else None


def _is_spot(squares: Floats, predicted: Floats, step_mm: float) -> bool:
    """True if the first section is a spot at the tip; `predicted` are the steps from the second section to the tip."""
    if len(squares) < 2:
        return False
    areas = np.sqrt(squares.prod(axis=1))
    is_near = predicted.size and ((predicted - 1.0) * step_mm < BEHIND_MM).all()
    return bool(areas[0] < areas[1] * (LARGEST_SPOT if is_near else BEHIND_MM / (BEHIND_MM + step_mm)))

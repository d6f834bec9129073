"""Where the surface ends along the travel: at heel and toes, which no stripe meets squarely."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import PLANE_MM

BEHIND_MM = 0.3
"""A tip that lies no farther behind the last stripe is lit by the edge of the laser's sheet, or just by its middle, and
the points lie on the sheet's middle nevertheless."""
BEFORE_MM = 0.5
"""The edge of the sheet lights a tip that its middle passes so far off."""
LARGEST_SPOT = 0.25
"""What the edge of the sheet draws of a tip is smaller than this share of the section one step before."""
AROUND_MM = 8.0
"""How far to either side of a stripe its toe may reach one step before; its neighbour's tip lies farther away."""
APART_MM = 2.5
"""Stripes with such a gap between them in Y are of two toes."""
FEWEST = 3
NEAREST_STEPS = 0.01
SECTIONS = 4
"""How many are looked at: three tell the tip, and the stripe beyond them whether it is one."""

Floats = NDArray[np.float64]
Numbers = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class TravelEnd:
    """One end of the travel; all X in mm."""

    outward: int
    """-1 where the travel starts, 1 at its end."""
    last_mm: float
    """The outermost stripe that tells where the surface is."""
    least_mm: float
    """How far beyond it the tip lies at least, ..."""
    most_mm: float
    """... at most, ..."""
    tip_mm: float | None
    """... and by what the sections foretell; None where there are too few of them."""

    @property
    def limit(self) -> float:
        """X beyond which nothing is."""
        return self.last_mm + self.outward * self.most_mm


def travel_ends(points: Floats, step_mm: float) -> tuple[Mask, tuple[TravelEnd, TravelEnd]]:
    """Points of a cloud that only graze a tip, and where the surface ends.

    Across and in height, the squared extents of an ellipsoid's or a paraboloid's sections at even distances lie on a
    parabola that does not bend up; where it falls to nothing is the tip. Beyond the last stripe it is within a step,
    for there would be another one. The last stripe itself is no section where the tip is about there: the edge of the
    sheet then draws a spot, which is seen where the middle of the sheet would be. It is told by its size: no larger
    than such a tip's section, or small where the sections before foretell such a tip.

    Parameters
    ----------
    points : (N, 3) mm, in stripe planes of constant X

    Returns
    -------
    grazing : (N,) points of such stripes
    ends : at the least and at the greatest X
    """
    grazing = np.zeros(len(points), np.bool_)
    ends = []
    for outermost, outward in ((points[:, 0].min(), -1), (points[:, 0].max(), 1)):
        tips, spots = list[float | None](), list[float | None]()
        for stripe in _stripes(points, np.abs(points[:, 0] - outermost) < PLANE_MM):
            squares = _sections(points, stripe, -outward * step_mm)
            foretold = _steps_to_tip(squares[1:])
            if _is_spot(squares, foretold, step_mm):
                grazing[stripe] = True
                spots.append(_mean(foretold))
            else:
                tips.append(_mean(_steps_to_tip(squares)))
        first = 0 if tips else 1
        known = [steps for steps in tips or spots if steps is not None]
        ends.append(
            TravelEnd(
                outward,
                last_mm=float(outermost - outward * first * step_mm),
                least_mm=first * (step_mm - BEFORE_MM),
                most_mm=step_mm + first * BEHIND_MM,
                tip_mm=max(known) * step_mm if known else None,
            )
        )
    return grazing, (ends[0], ends[1])


def drawn_to_tips(vertices: Floats, ends: tuple[TravelEnd, TravelEnd]) -> Floats:
    """The vertices, those beyond the last stripes moved along X so that they end where the tips are.

    The surface that goes on smoothly beyond a stripe foretells the tip too, by how it bends there; the sections do by
    how they shrink. They err apart from each other, and the middle between both is taken.
    """
    moved = vertices.copy()
    for end in ends:
        beyond = end.outward * (vertices[:, 0] - end.last_mm)
        reached = float(beyond.max())
        if reached <= 0.0:
            continue
        tip = reached if end.tip_mm is None else (reached + float(np.clip(end.tip_mm, end.least_mm, end.most_mm))) / 2
        change = float(np.clip(tip, end.least_mm, end.most_mm)) - reached
        bend = max(change, -reached - change)  # more, and what lies beyond would fold over
        share = np.maximum(beyond / reached, 0.0)
        moved[:, 0] += end.outward * (bend * share**2 + (change - bend) * share)
    return moved


def _stripes(points: Floats, of: Mask) -> list[Numbers]:
    """The points `of` a plane, by the toe they are of."""
    numbers = np.flatnonzero(of)
    numbers = numbers[np.argsort(points[numbers, 1], kind="stable")]
    return np.split(numbers, np.flatnonzero(np.diff(points[numbers, 1]) > APART_MM) + 1)


def _sections(points: Floats, stripe: Numbers, inward_mm: float) -> Floats:
    """(N, 2) squared extents in Y and Z, mm², of a stripe and those of the same tip in the planes before, `SECTIONS` at
    most."""
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
    """(K,) how many steps beyond the first of the sections parabolas through three of them, or lines through two, fall
    to nothing, for each of the two extents that shrinks.

    A parabola that bends up is none of one tip: a neighbouring toe is in the third section, and a line goes through the
    others.
    """
    if len(squares) < 2:
        return np.empty(0)
    shrinking = squares[:, squares[1] > squares[0]]
    curvature = np.minimum((shrinking[2] - 2 * shrinking[1] + shrinking[0]) / 2, 0.0) if len(squares) > 2 else 0.0
    slope = shrinking[1] - shrinking[0] - curvature
    return np.asarray(2 * shrinking[0] / (slope + np.sqrt(slope**2 - 4 * curvature * shrinking[0])))


def _mean(steps: Floats) -> float | None:
    """What both extents foretell; the farther it is, the less sure."""
    weights = 1.0 / np.maximum(steps, NEAREST_STEPS) ** 2
    return float(steps @ weights / weights.sum()) if steps.size else None


def _is_spot(squares: Floats, foretold: Floats, step_mm: float) -> bool:
    """Whether the first of the sections only tells that the tip is about there, by how many steps are `foretold` from
    the second one to it."""
    if len(squares) < 2:
        return False
    areas = np.sqrt(squares.prod(axis=1))
    is_near = foretold.size and ((foretold - 1.0) * step_mm < BEHIND_MM).all()
    return bool(areas[0] < areas[1] * (LARGEST_SPOT if is_near else BEHIND_MM / (BEHIND_MM + step_mm)))

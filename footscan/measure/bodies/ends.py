"""The ends of a foot, heel and toes: whether they are there."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from schemas.base.errors import Finding

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]
Part = Literal["heel", "toes"]

END, LOW, BLUNT, ROUNDED = 0.06, 0.15, 0.97, 0.4
"""Test of a whole heel or toes: in the last END of the length and up to LOW lengths high, skin that faces ahead, but by
less than the cosine BLUNT (a flat cut faces ahead by more), covers more than the share ROUNDED. Whole feet have 0.65 to
0.95, cut ones up to 0.2."""
BALL_STATION, GAPS = 0.70, 0.05
"""At this share of the length a foot is one piece, even with its toes spread; the gaps between the fingers of a hand
take more than this share of its breadth. Chosen by hand."""


def missing_ends(places: Floats, faces: Faces) -> tuple[Part, ...]:
    """Returns the ends that a foot lacks. Refuse one that lacks both, and a hand.

    Parameters
    ----------
    places : (V, 3) vertices in foot lengths, floor at Z = 0, heel to toes along X
    """
    corners = places[faces]
    low = corners[corners[:, :, 2].mean(axis=1) < LOW]
    if not len(low):
        raise Finding("the surface has nothing near its floor, expected a foot")
    rear, front = float(low[:, :, 0].min()), float(low[:, :, 0].max())
    ends: tuple[tuple[Part, float, float], ...] = (("heel", rear, -1.0), ("toes", front, 1.0))
    missing: list[Part] = []
    for part, end, ahead in ends:
        last = low[np.abs(low[:, :, 0].mean(axis=1) - end) < END]
        if _rounded(last, ahead) < ROUNDED:
            missing.append(part)
    if len(missing) == 2:
        raise Finding("the surface is cut off or open at the heel and at the toes, expected a foot with one of them")
    if missing:
        return tuple(missing)
    low[:, :, 0] -= rear
    if _parted(low) > GAPS:
        raise Finding("the surface has gaps from side to side where a foot has its ball, expected a foot")
    return ()


def _rounded(triangles: Floats, ahead: float) -> float:
    """Share of an end's outline, seen along X from `ahead`, that is skin and no flat cut: 0 to 1 of its hull."""
    if len(triangles) < 3:
        return 1.0
    crosses = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
    seen = ahead * crosses[:, 0]
    round_ = seen < BLUNT * np.linalg.norm(crosses, axis=1)
    return float(seen[round_].sum() / ConvexHull(triangles[:, :, 1:].reshape(-1, 2)).volume)


def _parted(triangles: Floats) -> float:
    """Share of the breadth of the section across the ball that lies between its parts."""
    is_ahead = triangles[:, :, 0] > BALL_STATION
    crossing = triangles[is_ahead.any(axis=1) & ~is_ahead.all(axis=1)]
    if not len(crossing):
        return 1.0
    x, y = crossing[:, :, 0] - BALL_STATION, crossing[:, :, 1]
    next_x, next_y = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    cut = (x > 0) != (next_x > 0)
    at = y + (next_y - y) * x / np.where(cut, x - next_x, 1.0)
    first, last = np.where(cut, at, np.inf).min(axis=1), np.where(cut, at, -np.inf).max(axis=1)
    order = np.argsort(first)
    reached = np.maximum.accumulate(last[order])
    gaps = np.clip(first[order][1:] - reached[:-1], 0.0, None)
    return float(gaps.sum() / (reached[-1] - first.min()))

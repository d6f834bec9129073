"""The outermost points of a foot that define its frame: heel, heads of the first and fifth metatarsal, longest toe.

All functions take (N, 3) `points` of the surface of a right foot in its own frame (mm, toes towards +X, medial side
towards +Y, floor at Z = 0) and its length in mm; windows are shares of the length. They return None if the window holds
no surface.
"""

import numpy as np
from numpy.typing import NDArray

from footscan.measure.landmarks.extreme import Summit, summit
from footscan.mesh.rigid_transform import FREE, points_within

Floats = NDArray[np.float64]

HEEL = 0.15
"""Share of the length, from the rearmost point, that holds the rear of the heel; chosen by hand."""
LONGEST_TOE = 0.80
"""Share of the length ahead of which the longest toe ends; chosen by hand."""
MEDIAL_BALL, LATERAL_BALL = (0.66, 0.80), (0.56, 0.72)
"""Windows of the heads of the first and fifth metatarsal; chosen by hand."""
MEDIAL_BALL_MM, LATERAL_BALL_MM, HEEL_MM = 45.0, 40.0, 40.0
"""Heights up to which the sides of ball and heel are sought, on a foot of `FULL_SIZE_MM` or more; chosen by hand."""
FULL_SIZE_MM = 200.0
"""Length of a foot below which such heights shrink in proportion; chosen by hand."""
HEEL_BREADTH = (0.10, 0.20)
"""Window of the heel's breadth; part of its definition."""
HEEL_SIDE = (0.05, 0.30)
"""Window of the heel's side for the medial tangent of the Brannock axis; chosen by hand."""
END_DEPTH_MM, SIDE_DEPTH_MM = 1.0, 0.7
"""Depths of the caps that are fitted: the ends of the foot are round, its sides flat. Chosen by hand."""
REACH = 0.06
"""Surface up to this share of the length outside a window supports the fit at its border; chosen by hand."""


def pternion(points: Floats, length: float, low: float) -> Summit | None:
    """The rearmost point of the heel, up to the height `low` in mm."""
    rear = points[:, 0].min(initial=np.inf)
    heel = points_within(points, x=(rear, rear + HEEL * length), z=(-np.inf, low))
    return summit(heel, 0, -1, (FREE, FREE), END_DEPTH_MM)


def foremost(points: Floats, length: float, low: float) -> Summit | None:
    """The tip of the longest toe."""
    toes = points_within(points, x=(LONGEST_TOE * length, np.inf), z=(-np.inf, low))
    return summit(toes, 0, 1, (FREE, FREE), END_DEPTH_MM)


def metatarsale_tibiale(points: Floats, length: float) -> Summit | None:
    """The most medial point of the head of the first metatarsal."""
    return outermost(points, length, 1, MEDIAL_BALL, MEDIAL_BALL_MM)


def metatarsale_fibulare(points: Floats, length: float) -> Summit | None:
    """The most lateral point of the head of the fifth metatarsal."""
    return outermost(points, length, -1, LATERAL_BALL, LATERAL_BALL_MM)


def heel_medial(points: Floats, length: float) -> Summit | None:
    """The most medial point of the heel where its breadth is taken."""
    return outermost(points, length, 1, HEEL_BREADTH, HEEL_MM)


def heel_lateral(points: Floats, length: float) -> Summit | None:
    """The most lateral point of the heel where its breadth is taken."""
    return outermost(points, length, -1, HEEL_BREADTH, HEEL_MM)


def outermost(points: Floats, length: float, side: int, along: tuple[float, float], height_mm: float) -> Summit | None:
    """Find the point farthest to one side in a window along the foot and up to a height.

    Parameters
    ----------
    side : 1 medial, -1 lateral
    along : shares of the length
    height_mm : on a foot of `FULL_SIZE_MM` or more; less on a smaller one
    """
    height = height_mm * min(1.0, length / FULL_SIZE_MM)
    first, last = along[0] * length, along[1] * length
    return outermost_in(points, side, (first, last), (-np.inf, height), REACH * length)


def outermost_in(
    points: Floats, side: int, along: tuple[float, float], heights: tuple[float, float], reach: float
) -> Summit | None:
    """Find the point farthest to one `side` in a window of X and Z, mm; the fit uses surface up to `reach` outside."""
    x, z = ((first - reach, last + reach) for first, last in (along, heights))
    return summit(points_within(points, x=x, z=z), 1, side, (along, heights), SIDE_DEPTH_MM)

"""The outermost points of a foot that its frame rests on: heel, heads of the first and fifth metatarsal, longest toe.

All take (N, 3) `points` of the surface of a right foot in its own frame (mm, toes towards +X, medial side towards +Y,
floor at Z = 0) and its length; windows are parts of the length. None where a window holds no surface.
"""

import numpy as np
from numpy.typing import NDArray

from footscan.measure.landmarks.extreme import Summit, summit
from footscan.mesh.rigid_transform import FREE, points_within

Floats = NDArray[np.float64]

HEEL = 0.15
LONGEST_TOE = 0.80
MEDIAL_BALL, LATERAL_BALL = (0.66, 0.80), (0.56, 0.72)
MEDIAL_BALL_MM, LATERAL_BALL_MM, HEEL_MM = 45.0, 40.0, 40.0
"""Heights up to which the sides of the ball and of the heel are sought, ..."""
FULL_SIZE_MM = 200.0
"""... on a foot of this length and more; on a child's they shrink with it."""
HEEL_BREADTH = (0.10, 0.20)
HEEL_SIDE = (0.05, 0.30)
END_DEPTH_MM, SIDE_DEPTH_MM = 1.0, 0.7
"""Of the caps that are fitted: along the foot it is round, sideways flat."""
REACH = 0.06
"""Surface so far outside a window supports the fit at its border."""


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
    """The point farthest to one `side`, 1 medial and -1 lateral, in a window along the foot and up to a height."""
    height = height_mm * min(1.0, length / FULL_SIZE_MM)
    first, last = along[0] * length, along[1] * length
    return outermost_in(points, side, (first, last), (-np.inf, height), REACH * length)


def outermost_in(
    points: Floats, side: int, along: tuple[float, float], heights: tuple[float, float], reach: float
) -> Summit | None:
    """The point farthest to one `side` in a window of X and Z; `reach` is how far outside it the fit may lean on. mm"""
    x, z = ((first - reach, last + reach) for first, last in (along, heights))
    return summit(points_within(points, x=x, z=z), 1, side, (along, heights), SIDE_DEPTH_MM)

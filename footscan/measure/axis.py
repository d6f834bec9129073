"""The foot's axis, which its lengths run along and its breadths across."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from footscan.measure.landmarks.extreme import Summit
from footscan.measure.landmarks.sides import (
    HEEL_MM,
    HEEL_SIDE,
    foremost,
    metatarsale_fibulare,
    metatarsale_tibiale,
    outermost,
    pternion,
)
from footscan.measure.landmarks.toes import tip_near, toe_tips
from footscan.mesh.rigid_transform import apply, low_height, turn_about_z
from schemas.base.errors import Finding
from schemas.measures import Axis

Floats = NDArray[np.float64]

TOE_FROM_BALL_DEG = 6.0
"""Seen from the heel, the second toe lies so near to the middle of the ball; what is farther off is another toe, taken
for the second where two have grown together in the scan."""
TURN_DEG, ROUNDS, TOES_TOLD = 0.003, 12, 2
"""The axis is found when it turns by less than this; after so many rounds toes keep their numbers."""


def along_axis(
    transform: Floats, low: Floats, forefoot: Floats, length: float, wish: Axis, marked: Mapping[str, Floats]
) -> tuple[Floats, Axis, float]:
    """The frame of a right foot along its axis. Where the points are that the axis runs between depends on the axis:
    both are sought in turn.

    Parameters
    ----------
    transform : (4, 4) to a frame with Z up from the floor, +X about towards the toes, +Y medial
    low, forefoot : (N, 3) and (M, 3) points of the surface below the leg, and closer ones of the forefoot, as the mesh
        lies
    length : about the foot's length, mm
    wish : the axis; "toe2" becomes "ball_center" where the second toe cannot be told
    marked : points that a person has set, as the mesh lies; pternion and toe_2_tip count

    Returns
    -------
    transform : (4, 4), the rearmost heel point above the origin, the axis along X
    axis, length : which one it is, and the foot's length along it
    """
    toe: Floats | None = None
    axis = wish
    for round_ in range(ROUNDS):
        moved = apply(transform, low)
        heel = _marked("pternion", marked, transform)
        heel = _found(pternion(moved, length, low_height(length))) if heel is None else heel
        shift = np.eye(4)
        shift[:2, 3] = -heel[:2]
        transform, moved = shift @ transform, apply(shift, moved)
        length = float(_found(foremost(moved, length, low_height(length)))[0])
        if wish == "brannock":
            medial = _found(metatarsale_tibiale(moved, length))
            turn = _direction(medial - _found(outermost(moved, length, 1, HEEL_SIDE, HEEL_MM)))
        elif (mark := _marked("toe_2_tip", marked, transform)) is not None and wish == "toe2":
            turn = _direction(mark)
        elif toe is not None and round_ >= TOES_TOLD:  # the toes are known: only its tip moves a little
            tip = tip_near(moved, toe)
            turn = _direction(toe if tip is None else tip.point)
        else:
            medial, lateral = (_found(find(moved, length)) for find in (metatarsale_tibiale, metatarsale_fibulare))
            middle = (medial + lateral) / 2
            toe = _second_toe(apply(transform, forefoot), moved, length, medial, lateral) if wish == "toe2" else None
            axis = "ball_center" if toe is None else "toe2"
            turn = _direction(middle if toe is None else toe)
        turned = turn_about_z(-turn)
        transform, toe = turned @ transform, None if toe is None else apply(turned, toe[None])[0]
        if abs(turn) < np.deg2rad(TURN_DEG):
            break
    return transform, axis, length


def _marked(name: str, marked: Mapping[str, Floats], transform: Floats) -> Floats | None:
    return apply(transform, np.asarray(marked[name], np.float64)[None])[0] if name in marked else None


def _second_toe(forefoot: Floats, points: Floats, length: float, medial: Floats, lateral: Floats) -> Floats | None:
    """The tip of the second toe, where it can be told apart."""
    sides = float(medial[1]), float(lateral[1])
    tip = toe_tips(forefoot, points, length, low_height(length), sides, wanted=(2,)).tips.get(2)
    if tip is None:
        return None
    aside = abs(_direction(tip.point) - _direction((medial + lateral) / 2))
    return tip.point if aside < np.deg2rad(TOE_FROM_BALL_DEG) else None


def _found(landmark: Summit | None) -> Floats:
    if landmark is None:
        raise Finding("the surface has no points where a landmark of a foot is expected")
    return landmark.point


def _direction(point: Floats) -> float:
    """Angle in radians from +X to a point on the floor, seen from the origin."""
    return float(np.arctan2(point[1], point[0]))

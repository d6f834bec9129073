"""The axis of a foot: lengths run along it, breadths across it."""

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
"""Seen from the heel, the second toe lies nearer than this to the middle of the ball. A toe farther off is another one,
taken for the second where two toes are merged in the scan. Chosen by hand."""
TURN_DEG, ROUNDS, NUMBERED_ROUNDS = 0.003, 12, 2
"""The axis is settled when it turns by less than the first, or after the second number of rounds. Toes are numbered in
the first rounds only, so that their numbers do not alternate. Chosen by hand."""


def along_axis(
    transform: Floats, low: Floats, forefoot: Floats, length: float, wish: Axis, marked: Mapping[str, Floats]
) -> tuple[Floats, Axis, float]:
    """Compute the frame of a right foot along its axis.

    The end points of the axis are outermost along it and so depend on it: points and axis are refined in turn.

    Parameters
    ----------
    transform : (4, 4) from the frame of the mesh to one with Z up from the floor, +X roughly to the toes, +Y medial
    low : (N, 3) mm, points of the surface below the leg, in the frame of the mesh
    forefoot : (M, 3) mm, denser points of the forefoot, in the frame of the mesh
    length : mm, approximate foot length
    wish : the requested axis; "toe2" becomes "ball_center" where the second toe cannot be identified
    marked : (3,) mm, points set by a person, in the frame of the mesh; pternion and toe_2_tip are used

    Returns
    -------
    transform : (4, 4), the rearmost heel point above the origin, the axis along X
    axis : the axis that was found
    length : mm, the foot length along it

    Raises
    ------
    Finding
        A window in which a landmark is sought holds no surface.
    """
    toe: Floats | None = None
    axis = wish
    for round_ in range(ROUNDS):
        moved = apply(transform, low)
        heel = _marked("pternion", marked, transform)
        heel = _point(pternion(moved, length, low_height(length))) if heel is None else heel
        shift = np.eye(4)
        shift[:2, 3] = -heel[:2]
        transform, moved = shift @ transform, apply(shift, moved)
        length = float(_point(foremost(moved, length, low_height(length)))[0])
        if wish == "brannock":
            medial = _point(metatarsale_tibiale(moved, length))
            turn = _direction(medial - _point(outermost(moved, length, 1, HEEL_SIDE, HEEL_MM)))
        elif (mark := _marked("toe_2_tip", marked, transform)) is not None and wish == "toe2":
            turn = _direction(mark)
        elif toe is not None and round_ >= NUMBERED_ROUNDS:  # the toe keeps its number, only its tip moves a little
            tip = tip_near(moved, toe)
            turn = _direction(toe if tip is None else tip.point)
        else:
            medial, lateral = (_point(find(moved, length)) for find in (metatarsale_tibiale, metatarsale_fibulare))
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
    """The tip of the second toe; None where it cannot be identified."""
    sides = float(medial[1]), float(lateral[1])
    tip = toe_tips(forefoot, points, length, low_height(length), sides, wanted=(2,)).tips.get(2)
    if tip is None:
        return None
    aside = abs(_direction(tip.point) - _direction((medial + lateral) / 2))
    return tip.point if aside < np.deg2rad(TOE_FROM_BALL_DEG) else None


def _point(landmark: Summit | None) -> Floats:
    if landmark is None:
        raise Finding("the surface has no points where a landmark of a foot is expected")
    return landmark.point


def _direction(point: Floats) -> float:
    """Angle in radians from +X to a point on the floor, seen from the origin."""
    return float(np.arctan2(point[1], point[0]))

"""Both feet of a person in one mesh: which is left, which is right, and their measures."""

from typing import Literal

import numpy as np

from footscan.measure.bodies.partial import measure_raw
from footscan.measure.bodies.raw_mesh import RawMesh
from footscan.mesh.rigid_transform import apply
from schemas.base.errors import Finding
from schemas.measures import Axis, Measures

ALIKE = 0.7
"""Feet stand side by side if they point the same way by more than this cosine; chosen by hand."""


def measure_pair(
    feet: tuple[RawMesh, RawMesh], axis: Axis = "toe2"
) -> dict[Literal["left", "right"], tuple[RawMesh, Measures]]:
    """Measure both feet. Their sides follow from their form; if both look alike, from their places side by side.

    Raises
    ------
    Finding
        One is no foot, or they are not a left and a right one.
    """
    first, second = (measure_raw(foot, "unknown", axis) for foot in feet)
    if first.side == second.side:
        is_first_right = _lies_right(feet[0], first, feet[1], second)
        if is_first_right is None:
            raise Finding(f"the surface has 2 separate bodies, both like a {first.side} foot, expected a pair")
        if is_first_right == (first.side == "right"):
            second = measure_raw(feet[1], "left" if is_first_right else "right", axis)
        else:
            first = measure_raw(feet[0], "right" if is_first_right else "left", axis)
        for foot in (first, second):
            if foot.side_note is not None:
                raise Finding(f"the surface has 2 separate bodies, and of the {foot.side} one {foot.side_note}")
    of_first, of_second = (feet[0], first), (feet[1], second)
    return {"left": of_first, "right": of_second} if first.side == "left" else {"left": of_second, "right": of_first}


def _lies_right(mesh: RawMesh, measures: Measures, other: RawMesh, of_other: Measures) -> bool | None:
    """True if a foot stands on the right of the other, False if on its left; None if not side by side."""
    transform, second = np.array(measures.transform), np.array(of_other.transform)
    if transform[0, :3] @ second[0, :3] < ALIKE:
        return None
    away = np.mean(apply(transform, other.vertices), axis=0) - np.mean(apply(transform, mesh.vertices), axis=0)
    if abs(away[1]) < abs(away[0]):
        return None
    is_mirrored = np.linalg.det(transform[:3, :3]) < 0
    return bool((away[1] > 0) != is_mirrored)

"""A parametric foot whose measures are known from its construction."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from footscan.virtual.foot.form import deformed, present_tips, pternion
from footscan.virtual.foot.measures import foremost_x, known_landmarks, known_measures
from footscan.virtual.foot.mesh import mesh_field
from footscan.virtual.foot.shape import FootShape, sample_pair, sample_shape
from footscan.virtual.foot.solve import solved_field
from footscan.virtual.portable import cos_sin, product

__all__ = ["Foot", "FootShape", "Side", "make_foot", "placed", "sample_pair", "sample_shape"]

Side = Literal["left", "right"]
MEAN_MAN = FootShape()
RATIOS = ("arch_index",)
"""Measures that do not grow with a foot."""


@dataclass(frozen=True)
class Foot:
    """A closed foot and what is known of it."""

    vertices: npt.NDArray[np.float64]
    """(N, 3), mm, on the exact surface to 0.001 times the resolution; the leg is cut flat."""
    faces: npt.NDArray[np.int32]
    """(M, 3), counter-clockwise seen from outside."""
    side: Side
    measures: dict[str, float]
    """mm; `foot_measures` defines each. They belong to the foot, not to its place."""
    landmarks: dict[str, npt.NDArray[np.float64]]
    """(3,) each, mm, in the frame of the vertices: pternion, metatarsale_tibiale, metatarsale_fibulare, landing_point,
    junction_point, toe_1_tip .. toe_5_tip."""


def make_foot(
    shape: FootShape = MEAN_MAN, *, side: Side = "right", resolution_mm: float = 1.0, size: float = 1.0
) -> Foot:
    """A foot with the measures of `shape`, standing on the floor.

    Scanner frame, mm: heel at X = 0, toes at larger X, the axis pternion - tip of toe 2 along X at Y = 0, floor at
    Z = 0. A right foot's medial side is +Y; a left foot is its mirror image. `resolution_mm` is the edge length of the
    mesh and leaves the measures alone; above 1 mm the gaps between the toes are coarse and may be bridged. The foot is
    enlarged by `size`; its measures are those of the enlarged foot.

    Raises
    ------
    RefusedInput
        No foot has these measures together.
    """
    field = deformed(solved_field(shape), shape)._replace(size=size)
    tips = present_tips(shape)
    length = max((tip[0] for tip in tips.values()), default=None) or foremost_x(field, shape.foot_length + 10.0)
    landmarks = known_landmarks(field, length)
    measures = known_measures(field, length, tips.get(1), landmarks)
    measures["scan_height"] = shape.scan_height
    landmarks["pternion"] = pternion(shape)
    landmarks |= {f"toe_{toe}_tip": tip for toe, tip in tips.items()}
    vertices, faces = mesh_field(field, length, shape.scan_height, resolution_mm / size)
    mirror = size * np.array([1.0, 1.0 if side == "right" else -1.0, 1.0])
    return Foot(
        vertices=vertices * mirror,
        faces=faces if side == "right" else np.ascontiguousarray(faces[:, ::-1]),
        side=side,
        measures={name: round(value * (1.0 if name in RATIOS else size), 6) for name, value in measures.items()},
        landmarks={name: np.array(point) * mirror for name, point in landmarks.items()},
    )


def placed(foot: Foot, x_mm: float, y_mm: float, turn_deg: float) -> Foot:
    """The foot turned about Z (counter-clockwise seen from above, about its pternion's foot) and then shifted."""
    cos, sin = cos_sin(turn_deg)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    shift = np.array([x_mm, y_mm, 0.0])
    return replace(
        foot,
        vertices=product(foot.vertices, turn.T) + shift,
        landmarks={name: product(point[None], turn.T)[0] + shift for name, point in foot.landmarks.items()},
    )

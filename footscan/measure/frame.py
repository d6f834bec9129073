"""The foot's own frame: where its heel is, and which way its axis runs."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.measure.landmarks import (
    LOW_MM,
    SAMPLE_MM2,
    highest,
    is_right,
    length_from,
    lowest,
    metatarsale_fibulare,
    metatarsale_tibiale,
    pternion,
    second_toe_tip,
)
from footscan.surface.sampling import sample_surface, surface_area
from footscan.surface.topology import keep_large_components, used_vertices
from schemas.errors import Finding
from schemas.measures import Axis
from schemas.scan import Side

STRAY_SHARE = 0.02
"""Parts of a mesh with less than this share of its triangles are not the foot."""
DIAGONAL_MM = (150.0, 600.0)
LENGTH_MM = (100.0, 380.0)
SLENDERNESS = (1.7, 4.5)
"""Length over breadth of what can be a foot."""
GLASS_MM = 3.0
"""A mesh whose lowest point is closer than this to Z = 0 stands on the glass."""
TOE_FROM_BALL_DEG = 6.0
"""Seen from the heel, the second toe lies so near to the middle of the ball; what is farther off is another toe, taken
for the second where two have grown together in the scan."""
TURN_DEG = 0.05
"""The axis is found when it turns by less than this."""


class FootFrame(NamedTuple):
    """A foot in its own frame: mm, +X from heel to toes along the axis, Z up, origin on the floor below the rearmost
    heel point; a left foot mirrored into a right one, so that +Y is medial."""

    vertices: NDArray[np.float64]
    """(V, 3)"""
    faces: NDArray[np.int32]
    """(F, 3), strays left out."""
    samples: NDArray[np.float64]
    """(N, 3) points spread evenly over the surface, one for each `SAMPLE_MM2`."""
    transform: NDArray[np.float64]
    """(4, 4) from the frame of the mesh to this one."""
    axis: Axis
    length: float
    """Foot length, mm."""


def foot_frame(vertices: NDArray[np.floating], faces: NDArray[np.integer], side: Side) -> FootFrame:
    """The frame of a foot that lies in the scanner, sole down, turned by any angle about the vertical.

    The axis runs from the rearmost heel point to the tip of the second toe ("toe2"); where toes cannot be told apart,
    to the middle of the ball ("ball_center"). Where these points are depends on the axis: both are sought in turn.

    Parameters
    ----------
    vertices : (V, 3) mm
    faces : (F, 3)
    side : a foot of unknown side is told by its toes

    Raises
    ------
    Finding
        This is no foot, or not in mm.
    """
    vertices, faces = used_vertices(np.asarray(vertices, np.float64), keep_large_components(faces, STRAY_SHARE))
    _check_size(vertices)
    samples = sample_surface(vertices, faces, round(surface_area(vertices, faces) / SAMPLE_MM2))

    transform = _on_floor(vertices)
    transform = _heel_to_toe(apply(transform, samples)) @ transform
    if side == "left" or (side == "unknown" and not is_right(apply(transform, samples))):
        transform = np.diag([1.0, -1.0, 1.0, 1.0]) @ transform
        faces = faces[:, ::-1]
    transform, axis = _along_axis(transform, samples)
    moved = apply(transform, samples)
    length = length_from(moved, 0.0)
    _check_proportions(moved, length)
    return FootFrame(apply(transform, vertices), faces, moved, transform, axis, length)


def apply(transform: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) `points` moved by a (4, 4) `transform`."""
    moved: NDArray[np.float64] = points @ transform[:3, :3].T + transform[:3, 3]
    return moved


def _check_size(vertices: NDArray[np.float64]) -> None:
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0))) if len(vertices) else 0.0
    if not DIAGONAL_MM[0] <= diagonal <= DIAGONAL_MM[1]:
        expected = f"expected a foot of {DIAGONAL_MM[0]:.0f} to {DIAGONAL_MM[1]:.0f} mm in mm"
        raise Finding(f"the surface is {diagonal:.3g} across, {expected}")


def _on_floor(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """The glass at Z = 0 is the floor; a mesh that is nowhere near stands on its lowest point."""
    transform = np.eye(4)
    lowest_z = float(vertices[:, 2].min())
    transform[2, 3] = 0.0 if abs(lowest_z) < GLASS_MM else -lowest_z
    return transform


def _heel_to_toe(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turns the long direction of the sole into X, the end with the leg above it towards -X."""
    low = samples[samples[:, 2] <= LOW_MM]
    _, vectors = np.linalg.eigh(np.cov(low[:, :2].T))
    turned = _turn(-np.arctan2(vectors[1, -1], vectors[0, -1]))
    x = apply(turned, samples)[:, 0]
    first, last = np.quantile(x[samples[:, 2] <= LOW_MM], [0, 1])
    fifth = (last - first) / 5
    height_at_first, height_at_last = samples[x < first + fifth, 2].max(), samples[x > last - fifth, 2].max()
    return _turn(np.pi) @ turned if height_at_last > height_at_first else turned


def _along_axis(transform: NDArray[np.float64], samples: NDArray[np.float64]) -> tuple[NDArray[np.float64], Axis]:
    """`transform`, with the rearmost heel point brought to the origin and the axis to X."""
    for _ in range(10):
        transform = _heel_to_origin(apply(transform, samples)) @ transform
        moved = apply(transform, samples)
        length = length_from(moved, 0.0)
        ball = (metatarsale_tibiale(moved, length) + metatarsale_fibulare(moved, length)) / 2
        toe = second_toe_tip(moved, length)
        is_second = toe is not None and abs(np.rad2deg(_direction(toe) - _direction(ball))) <= TOE_FROM_BALL_DEG
        axis: Axis = "toe2" if is_second else "ball_center"
        target = toe if toe is not None and is_second else ball
        turn = _direction(target)
        transform = _turn(-turn) @ transform
        if abs(turn) < np.deg2rad(TURN_DEG):
            break
    return _heel_to_origin(apply(transform, samples)) @ transform, axis


def _direction(point: NDArray[np.float64]) -> float:
    """Angle in radians from +X to a point on the floor, seen from the origin."""
    return float(np.arctan2(point[1], point[0]))


def _heel_to_origin(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    shift = np.eye(4)
    shift[:2, 3] = -pternion(samples)[:2]
    return shift


def _turn(angle: float) -> NDArray[np.float64]:
    """(4, 4) rotation about Z by `angle` in radians."""
    transform = np.eye(4)
    transform[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return transform


def _check_proportions(samples: NDArray[np.float64], length: float) -> None:
    low = samples[samples[:, 2] <= LOW_MM]
    breadth = highest(low[:, 1]) - lowest(low[:, 1])
    if not (LENGTH_MM[0] <= length <= LENGTH_MM[1] and SLENDERNESS[0] <= length / breadth <= SLENDERNESS[1]):
        raise Finding(f"the surface is {length:.0f} mm long and {breadth:.0f} mm broad, expected a foot")

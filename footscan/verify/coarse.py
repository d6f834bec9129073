"""Candidate poses for a registration from any start: many rotations, of which the better ones are refined further."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from footscan.verify.icp import Poses, capped_squares, step
from footscan.verify.nearest import CloudSurface, Floats

SPIRAL = 120
"""Rotations of the spiral; four times as many poses are tried. Bound of time."""
ROUNDS = ((504, 100, 6), (100, 250, 8), (30, 500, 12))
"""Bounds of time of each round: largest number of poses, points of each pose, and steps."""
SURFACE_POINTS = 1500
"""Bound of time: points that represent a surface."""
SCALE_MEDIANS = 4.0
"""Tukey's scale in medians of the distances, so that it is large while a pose is far away; chosen by hand."""
SMALLEST_SCALE = 0.015
"""Least Tukey's scale as a share of the size of the shape, about the spacing of the points; chosen by hand."""
CAPPED = 0.03
"""Distances are capped at this share of the size of the shape: farther points have no counterpart. Chosen by hand."""
ALONG_SURFACE = 0.1
"""Weight of the offset along the surface; that across it has weight 1. Chosen by hand."""
SAME_POSE = 0.03
"""Poses are the same if no point of the shape differs by more than this share of its size; chosen by hand."""


@dataclass(frozen=True)
class Sketch:
    """A shape as few points, its mean at the origin, its principal axes along those of the frame."""

    points: Floats
    """(N, 3) mm, evenly spread, in random order"""
    surface: CloudSurface
    """The surface of the first `SURFACE_POINTS`"""
    size: float
    """Diagonal of the bounding box, mm"""


def sketch(points: Floats) -> Sketch:
    """Make a sketch of `points`, which are as in `Sketch`."""
    return Sketch(points, CloudSurface(points[:SURFACE_POINTS]), float(np.linalg.norm(np.ptp(points, axis=0))))


def candidates(moving: Sketch, fixed: Sketch) -> tuple[Poses, NDArray[np.intp]]:
    """Find distinct poses that bring `moving` near `fixed`, the best first, and the number of starts of each."""
    poses = start_poses()
    starts = np.ones(len(poses), np.intp)
    for kept, points, steps in ROUNDS:
        poses, starts = poses[:kept], starts[:kept]
        scale = np.full(len(poses), fixed.size)
        for _ in range(steps):
            poses, _, fit = step(poses, moving.points[:points], fixed.surface, scale, ALONG_SURFACE)
            scale = np.maximum(SCALE_MEDIANS * np.median(fit.distances, axis=1), SMALLEST_SCALE * fixed.size)
        best_first = np.argsort(cost(poses, moving, fixed, points), kind="stable")
        poses, starts = distinct(poses[best_first], starts[best_first], moving.points, SAME_POSE * fixed.size)
    return poses, starts


def start_poses() -> Poses:
    """Rotations between the axes of two shapes: the 24 that bring axes onto axes, and an even spiral of others.

    The axes have no sign; half a turn of either shape around any of them leaves the set unchanged.
    """
    axes = Rotation.create_group("O").as_matrix()
    half_turns = np.array([np.diag(signs) for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))], np.float64)
    spiral = np.einsum("aij,bjk->abik", super_fibonacci(SPIRAL), half_turns).reshape(-1, 3, 3)
    rotations = np.concatenate([axes, spiral])
    return Poses(rotations, np.zeros((len(rotations), 3)))


def super_fibonacci(count: int) -> Floats:
    """Returns (count, 3, 3) evenly spread rotations (Alexa, "Super-Fibonacci spirals", CVPR 2022, algorithm 1)."""
    phi, psi = np.sqrt(2.0), 1.533751168755204288118041
    s = np.arange(count) + 0.5
    r, big_r = np.sqrt(s / count), np.sqrt(1 - s / count)
    alpha, beta = 2 * np.pi * s / phi, 2 * np.pi * s / psi
    quaternions = np.column_stack([r * np.sin(alpha), r * np.cos(alpha), big_r * np.sin(beta), big_r * np.cos(beta)])
    rotations: Floats = Rotation.from_quat(quaternions).as_matrix()
    return rotations


def cost(poses: Poses, moving: Sketch, fixed: Sketch, points: int) -> Floats:
    """Returns (S,) the mean square of the capped distances in both directions, in mm².

    Both directions count, since a part fits into a whole, but not the whole into it.
    """
    cap = CAPPED * fixed.size
    there = capped_squares(poses, moving.points[:points], fixed.surface, cap)
    back = capped_squares(poses.inverse(), fixed.points[:points], moving.surface, cap)
    squares: Floats = there.mean(axis=1) + back.mean(axis=1)
    return squares


def distinct(poses: Poses, starts: NDArray[np.intp], points: Floats, apart: float) -> tuple[Poses, NDArray[np.intp]]:
    """Merge `poses` that place no point more than `apart` mm from the first of them; their `starts` are summed."""
    placed = poses.place(corners(points))
    chosen: list[int] = []
    sums: list[int] = []
    for index, pose in enumerate(placed):
        gaps = np.linalg.norm(placed[np.array(chosen, np.intp)] - pose, axis=2).max(axis=1)
        near = np.flatnonzero(gaps <= apart)
        if len(near):
            sums[near[0]] += int(starts[index])
        else:
            chosen.append(index)
            sums.append(int(starts[index]))
    return poses[np.array(chosen)], np.array(sums)


def corners(points: Floats) -> Floats:
    """Returns (8, 3) the corners of the box around `points`; no point of it moves farther than one of them."""
    low, high = points.min(axis=0), points.max(axis=0)
    upper = np.array(list(product((False, True), repeat=3)))
    box: Floats = np.where(upper, high, low)
    return box

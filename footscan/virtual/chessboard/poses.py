"""Poses of a chessboard as a person would hold it before a camera."""

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.chessboard.printed_board import PrintedBoard
from footscan.virtual.optics.scanner import HEIGHT, WIDTH, Camera, Laser

Floats = NDArray[np.float64]

BORDER_PX = 6.0
"""The paper keeps this distance from the border of the picture. Chosen by hand."""
ABOVE_GLASS_MM = 1.0
"""The paper keeps this distance from the glass. Chosen by hand."""
TILT_DEG = (10.0, 45.0)
"""Between the board's normal and the line of sight. Chosen by hand."""
DEPTH_MM = 35.0
"""The middle of the board stands up to this far before or behind the laser plane, along the line of sight."""
LEAST_COSINE = 0.3
"""Of the laser's angle of incidence on the board, and of the board's angle to the laser plane. Chosen by hand."""
MOST_DRAWS = 100_000
"""A bound of time."""


def held_poses(
    board: PrintedBoard, camera: Camera, lasers: tuple[Laser, ...], count: int, seed: int
) -> list[PrintedBoard]:
    """Draw poses in which `camera` sees the whole board, and a laser lights it along a line across its middle part."""
    random = np.random.default_rng([seed, camera.id, 6])
    poses: list[PrintedBoard] = []
    for _ in range(MOST_DRAWS):
        if len(poses) == count:
            return poses
        held = _drawn(board, camera, random)
        if in_view(held, camera) and _is_lit(held, lasers):
            poses.append(held)
    raise ValueError(f"camera {camera.id} sees the whole board in {len(poses)} of {count} poses")


def in_view(board: PrintedBoard, camera: Camera) -> bool:
    """Whether the camera sees the front of the whole paper, above the glass."""
    pixels = camera.project(board.outline)
    if not np.isfinite(pixels).all():
        return False
    inside = (pixels > BORDER_PX) & (pixels < np.array([WIDTH, HEIGHT]) - 1.0 - BORDER_PX)
    front = float((board.outline.mean(axis=0) - camera.position) @ board.axes[2]) > 0.0
    return bool(inside.all() and front and (board.outline[:, 2] > ABOVE_GLASS_MM).all())


def _drawn(board: PrintedBoard, camera: Camera, random: np.random.Generator) -> PrintedBoard:
    pixel = np.array([[random.uniform(0.2, 0.8) * WIDTH, random.uniform(0.2, 0.8) * HEIGHT]])
    origins, directions = camera.rays(pixel)
    origin, sight = origins[0], directions[0]
    middle = origin + sight * (-origin[0] / sight[0] + random.uniform(-DEPTH_MM, DEPTH_MM))
    tilt, towards, roll = np.radians(random.uniform(*TILT_DEG)), *random.uniform(0.0, 2.0 * np.pi, 2)
    right = camera.rotation[0] - (camera.rotation[0] @ sight) * sight
    right /= np.linalg.norm(right)
    down = np.cross(sight, right)
    tipped = np.cos(towards) * right + np.sin(towards) * down
    into = np.cos(tilt) * sight + np.sin(tilt) * tipped
    along = np.cos(roll) * right + np.sin(roll) * down
    along = along - (along @ into) * into
    along /= np.linalg.norm(along)
    axes = np.stack([along, np.cross(into, along), into])
    half = board.square_mm * (np.array(board.squares) - 2.0) / 2.0
    return board.moved(middle - half @ axes[:2], axes)


def _is_lit(board: PrintedBoard, lasers: tuple[Laser, ...]) -> bool:
    normal = -board.axes[2]
    if abs(normal[0]) > np.sqrt(1.0 - LEAST_COSINE**2):
        return False  # nearly parallel to the laser plane
    corners = board.corners
    if not corners[:, 0].min() < -board.square_mm < board.square_mm < corners[:, 0].max():
        return False
    middle = corners.mean(axis=0)
    ways = np.array([np.asarray(laser.position) - middle for laser in lasers])
    return bool((ways @ normal / np.linalg.norm(ways, axis=1)).max() > LEAST_COSINE)

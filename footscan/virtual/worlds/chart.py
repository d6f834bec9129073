"""The chart that a world's scanner is calibrated with: corners of the reference object in the laser planes."""

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.optics.scanner import Camera
from footscan.virtual.stage.reference import standard_reference
from footscan.virtual.worlds.machine import BEND_HALF_MM, Machine, Pose, moved_camera

Floats = NDArray[np.float64]

PLANE_STEPS = 4
"""Fixed-point steps to the X at which a sheet that is slightly tilted and bent meets an edge along X."""
COLUMNS = ("camera", "point", "x_mm", "y_mm", "z_mm", "i", "j", "width_px", "height_px")


def world_chart(machine: Machine) -> str:
    """Return the chart, as CSV, of all cameras.

    The object's edges run along X, so a corner's Y and Z are exact wherever the sheet meets the edge; its pixel is off
    by `corner_px`.
    """
    reference = standard_reference()
    profile = np.asarray(reference.profile_mm)
    corners = np.concatenate([profile + np.asarray(place) for place in reference.placements_mm])
    rows, columns = machine.size
    has_lasers = any(sheet.ahead_mm for sheet in machine.sheets)
    lines = [",".join(COLUMNS + ("laser",) * has_lasers) + "\n"]
    for camera_id, camera in machine.calibrated.items():
        pose = machine.calibration_pose(machine.head_of[camera_id])
        random = np.random.default_rng([machine.world.seed, 400 + camera_id])
        for laser, sheet in enumerate(machine.sheets_of(camera_id), start=1):
            points = on_sheet(corners, sheet.pose(pose), machine.world.laser.bend_mm)
            pixels = moved_camera(camera, pose).project(points)
            seen = _can_be_seen(camera, corners, pixels, rows, columns)
            located = pixels + random.normal(0.0, machine.world.cameras.corner_px, pixels.shape)
            of_laser = f",{laser}" * has_lasers
            lines += [
                f"{camera_id},{n},{sheet.ahead_mm:g},{y:g},{z:g},{i:.4f},{j:.4f},{columns},{rows}{of_laser}\n"
                for n, ((y, z), (i, j)) in enumerate(zip(corners[seen], located[seen], strict=True), start=1)
            ]
    return "".join(lines)


def on_sheet(corners: Floats, pose: Pose, bend_mm: float) -> Floats:
    """Points (N, 3), scanner frame, at which edges along X through `corners` (N, 2) meet the sheet of a head."""
    x = np.zeros(len(corners))
    for _ in range(PLANE_STEPS):
        points = np.column_stack([x, corners])
        own = pose.undo(points)
        distance = own[:, 0] - bend_mm * (own[:, 1] / BEND_HALF_MM) ** 2
        x = x - distance / pose.turn[0, 0]
    return np.column_stack([x, corners])


def _can_be_seen(camera: Camera, corners: Floats, pixels: Floats, rows: int, columns: int) -> NDArray[np.bool_]:
    """True for corners within the picture and on the camera's side: left, right or below."""
    inside = (pixels > 0.0).all(axis=1) & (pixels[:, 0] < columns - 1) & (pixels[:, 1] < rows - 1)
    y, z = corners.T
    if camera.below_glass:
        return np.asarray(inside & (z < 80.0))
    return np.asarray(inside & (y > -21.0 if camera.position[1] > 0.0 else y < 21.0))

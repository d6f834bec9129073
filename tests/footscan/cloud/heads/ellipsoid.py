"""Stripe points of a scanner with three heads over an ellipsoid, computed directly."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import POINT_DTYPE, make_points
from footscan.cloud.views import View

HALF_AXES = np.array([110.0, 45.0, 40.0])
MIDDLE = np.array([150.0, 0.0, 57.0])
CENTRES = {
    1: (150.0, 180.0, 250.0), 2: (-150.0, 180.0, 250.0), 3: (150.0, -180.0, 250.0), 4: (-150.0, -180.0, 250.0),
    5: (150.0, 120.0, -200.0), 6: (-150.0, 120.0, -200.0), 7: (150.0, -120.0, -200.0), 8: (-150.0, -120.0, -200.0),
}  # fmt: skip
HEADS = {1: 0, 2: 0, 3: 1, 4: 1, 5: 2, 6: 2, 7: 2, 8: 2}
LIGHT = np.array([[0.7, 0.7], [-0.7, 0.7], [0.0, -1.0]])
"""Direction in (Y, Z) from which the laser of each head shines."""
MERGED_MM = 1.2
"""Lines that are closer are one in the picture: the brightest."""
STEP_MM, NOISE_MM = 3.0, 0.02


def views() -> dict[int, View]:
    return {camera: View(np.array(centre), np.empty((0, 2))) for camera, centre in CENTRES.items()}


def points_of(offsets: Sequence[float], turn: float = 0.0, shared: bool = True) -> NDArray[np.void]:
    """Points of all cameras, mapped as if each laser plane stood where its head's travel says.

    offsets : X of the plane of each head from there, mm
    turn : yaw of the plane of the first head, mm per mm
    shared : all lasers shine at once, so that each camera sees the lines of all heads
    """
    random = np.random.default_rng(5)
    parts = [np.empty(0, POINT_DTYPE)]
    angles = np.arange(0.0, 2 * np.pi, 0.008)
    for frame, x in enumerate(np.arange(42.0, 260.0, STEP_MM)):
        for camera, centre in CENTRES.items():
            source = 0
            for laser, offset in enumerate(offsets):
                if laser != HEADS[camera] and not shared:
                    continue
                yz = _section(x + offset, angles, turn if laser == 0 else 0.0)
                facing = (np.array(centre)[1:] - yz) * (yz - MIDDLE[1:]) / HALF_AXES[1:] ** 2
                yz = yz[(facing.sum(axis=1) > 1.0) & _shows(yz, laser, offsets, shared)]
                turned = turn * yz[:, 0]
                plane = offset + turned * (laser == 0)
                own = offsets[HEADS[camera]] + turned * (HEADS[camera] == 0)
                yz = yz + ((own - plane) / centre[0])[:, None] * (np.array(centre)[1:] - yz)
                yz = yz + random.normal(0.0, NOISE_MM, yz.shape)
                xyz = np.column_stack([np.full(len(yz), x), yz])
                number = np.arange(source, source + len(yz))
                parts.append(make_points(xyz, camera, frame, number, sigma=NOISE_MM))
                source += len(yz) + 1
    return np.concatenate(parts)


def _shows(yz: NDArray[np.float64], laser: int, offsets: Sequence[float], shared: bool) -> NDArray[np.bool_]:
    """Whether the line of a laser is seen at each place (N, 2)."""
    normals = (yz - MIDDLE[1:]) / HALF_AXES[1:] ** 2
    light = normals @ LIGHT.T
    shows = light[:, laser] > 0.0
    for other, offset in enumerate(offsets):
        if shared and other != laser and abs(offset - offsets[laser]) < MERGED_MM:
            shows &= light[:, laser] >= light[:, other]
    return np.asarray(shows)


def _section(x: float, angles: NDArray[np.float64], turn: float) -> NDArray[np.float64]:
    """(N, 2) the section of the ellipsoid by a plane at X, turned about Z by `turn`."""
    yz = np.zeros((len(angles), 2))
    for _ in range(4):  # the radius at each angle follows from X there
        size = np.sqrt(np.maximum(1.0 - ((x + turn * yz[:, 0] - MIDDLE[0]) / HALF_AXES[0]) ** 2, 0.0))
        yz = MIDDLE[1:] + size[:, None] * HALF_AXES[1:] * np.column_stack([np.cos(angles), np.sin(angles)])
    return yz

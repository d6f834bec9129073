"""The place of a body on the glass."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from footscan.calibration.travel.nearest_face import NearestFace

Floats = NDArray[np.float64]

STARTS = 24
"""Turns about Z from which the place is searched."""
USED, ROUNDS, SETTLED = 400, 25, 1e-4
"""Points that are used, about, and rounds of the search: bounds of time."""
NEAR_MM = 0.5
"""Distances below this count as squares, larger ones as they are."""
FARTHEST_MM = 4.0
"""Distances count up to this where places are compared."""
INNER = 0.02
"""Quantile of the points' coordinates at which the body begins."""


class Place(NamedTuple):
    """Body frame to scanner frame."""

    turn: Floats
    """(3, 3)"""
    shift: Floats
    """(3,) mm"""

    def into(self, xyz: Floats) -> Floats:
        """Points (N, 3) of the scanner frame in the body's frame."""
        return np.asarray((xyz - self.shift) @ self.turn)

    def stepped(self, step: Floats) -> "Place":
        """The place turned by a rotation vector about the body's origin, and moved, mm: both in `step` (6,)."""
        return Place(Rotation.from_rotvec(step[:3]).as_matrix() @ self.turn, self.shift + step[3:])


def find_place(xyz: Floats, surface: NearestFace) -> Place:
    """Find where the body roughly stands, upright on the glass, by its fit from many turns; `xyz` (N, 3), mm."""
    xyz = xyz[:: max(1, len(xyz) // USED)]
    middle = 0.5 * (np.quantile(xyz, INNER, axis=0) + np.quantile(xyz, 1.0 - INNER, axis=0))
    places = []
    for angle in np.arange(STARTS) * 2.0 * math.pi / STARTS:
        turn = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()
        places.append(
            _settled(xyz, surface, Place(turn, np.append(middle[:2] - turn[:2, :2] @ surface.middle[:2], 0.0)))
        )
    return min(places, key=lambda found: found[1])[0]


def _settled(xyz: Floats, surface: NearestFace, place: Place) -> tuple[Place, float]:
    """The place to which a start leads, and the mean distance of the points, mm."""
    for _ in range(ROUNDS):
        distance, normal, _ = surface.distances(place.into(xyz))
        outward = normal @ place.turn.T
        root = np.maximum(np.abs(distance), NEAR_MM) ** -0.5
        rows = -np.hstack([np.cross(xyz - place.shift, outward), outward])
        step = np.asarray(np.linalg.lstsq(rows * root[:, None], distance * root, rcond=1e-9)[0], np.float64)
        place = place.stepped(step)
        if np.linalg.norm(step) < SETTLED:
            break
    distance, _, _ = surface.distances(place.into(xyz))
    return place, float(np.mean(np.minimum(np.abs(distance), FARTHEST_MM)))

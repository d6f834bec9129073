"""The stripe over a cross, as a pinhole at the upper left sees it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from schemas.mounting import Mounting

Floats = NDArray[np.float64]
CROSS = [
    [-20, 0], [20, 0], [20, 30], [50, 30], [50, 70], [20, 70], [20, 100], [-20, 100], [-20, 70], [-50, 70], [-50, 30],
    [-20, 30],
]  # fmt: skip
SEEN_FROM_UPPER_LEFT = [[(50, 30), (50, 70)], [(50, 70), (20, 70)], [(20, 70), (20, 100)], [(20, 100), (-20, 100)]]
PLACEMENTS = np.array([(0.0, 0.0), (25.0, 0.0), (-25.0, 10.0)])
UPPER_LEFT = Mounting(1, 1, 1)


def filmed(camera: Any, places: Floats, noise_px: float = 0.1, seed: int = 1) -> list[Floats]:
    """The stripe's points in each placement, as a camera at the upper left sees them, a millimetre apart."""
    random = np.random.default_rng(seed)
    along = [
        np.array(a) + share * (np.array(b, float) - a)
        for a, b in SEEN_FROM_UPPER_LEFT
        for share in np.arange(0, 1, 1 / np.hypot(*(np.array(b) - a)) / 3)
    ]
    stripes = []
    for place in places:
        pixels = seen_at(camera, np.array(along) + place)
        stripes.append(random.permutation(pixels + random.normal(0, noise_px, pixels.shape)))
    return stripes


def seen_at(camera: Any, plane: Floats) -> Floats:
    points = np.column_stack([plane, np.ones(len(plane))]) @ np.linalg.inv(camera.to_plane()).T
    return np.asarray(points[:, :2] / points[:, 2:])

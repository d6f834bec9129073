"""A convex body, and what eight cameras around it see of it."""

from collections.abc import Callable

import numpy as np
import pytest

from footscan.cloud.points import make_points
from footscan.cloud.views import View

SEMI_AXES = np.array([50.0, 30.0, 25.0])
MIDDLE = np.array([60.0, 0.0, 25.0])
"""An ellipsoid that stands on the glass, its long axis along the travel."""
ALL_PLANE = np.array([[-80.0, -30.0], [80.0, -30.0], [80.0, 130.0], [-80.0, 130.0]])


@pytest.fixture
def views() -> dict[int, View]:
    """Four cameras above, four below, the odd ones in front."""
    places = {
        1: (200, 217, 150), 2: (-200, 217, 150), 3: (200, -217, 150), 4: (-200, -217, 150),
        5: (166, 97, -145), 6: (-166, 97, -145), 7: (166, -97, -145), 8: (-166, -97, -145),
    }  # fmt: skip
    return {camera: View(np.array(place, np.float64), ALL_PLANE) for camera, place in places.items()}


@pytest.fixture
def ellipsoid(views: dict[int, View]) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Its points as the cameras see them, planes `step` apart, and their normals."""

    def film(step: float = 2.0, offsets: dict[int, float] | None = None) -> tuple[np.ndarray, np.ndarray]:
        parts, normals = [], []
        for camera, view in views.items():
            places = np.arange(0.0, 120.0, step) + (offsets or {}).get(camera, 0.0)
            for frame, x in enumerate(places):
                outline = section(x)
                outward = (outline - MIDDLE) / SEMI_AXES**2
                outward /= np.linalg.norm(outward, axis=1, keepdims=True)
                towards = view.centre + np.array([x, 0.0, 0.0]) - outline
                seen = np.sum(outward * towards, axis=1) > 0.15 * np.linalg.norm(towards, axis=1)
                rows = np.arange(seen.sum())
                parts.append(make_points(outline[seen], camera=camera, frame=frame, source=rows + 10_000 * frame))
                normals.append(outward[seen])
        return np.concatenate(parts), np.concatenate(normals)

    return film


def section(x: float) -> np.ndarray:
    """Points 0.4 mm apart, or less, along the ellipsoid's outline at `x`."""
    size = 1.0 - ((x - MIDDLE[0]) / SEMI_AXES[0]) ** 2
    if size <= 0:
        return np.empty((0, 3))
    count = int(2 * np.pi * SEMI_AXES[1] * np.sqrt(size) / 0.4) + 8
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    y, z = (np.sqrt(size) * SEMI_AXES[axis] * turn(angle) for axis, turn in ((1, np.cos), (2, np.sin)))
    return np.column_stack([np.full(count, x), y, MIDDLE[2] + z])

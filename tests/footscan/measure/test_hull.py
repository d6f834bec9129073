"""The hull against Qhull, and where there is none."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from footscan.measure.hull import hull_corners


@pytest.mark.parametrize("seed", range(20))
def test_corners_are_those_of_qhull(seed: int) -> None:
    random = np.random.default_rng(seed)
    turns = random.uniform(0, 2 * np.pi, 300)
    points = np.column_stack([80 * np.cos(turns), 40 * np.sin(turns)]) + random.normal(0, 3.0 * (seed % 3), (300, 2))
    points = np.concatenate([points, points[::7]])  # some are repeated
    found, expected = hull_corners(points), ConvexHull(points)
    assert {tuple(point) for point in points[found]} == {tuple(point) for point in points[expected.vertices]}
    sides = np.roll(points[found], -1, axis=0) - points[found]
    assert np.hypot(*sides.T).sum() == pytest.approx(expected.area, rel=1e-12)
    assert np.all(sides[:, 0] * np.roll(sides, -1, axis=0)[:, 1] > sides[:, 1] * np.roll(sides, -1, axis=0)[:, 0])


def test_points_on_a_side_are_no_corners() -> None:
    x, y = np.meshgrid(np.arange(5.0), np.arange(4.0))
    corners = hull_corners(np.column_stack([x.ravel(), y.ravel()]))
    assert sorted(corners.tolist()) == [0, 4, 15, 19]


@pytest.mark.parametrize("points", [np.zeros((1, 2)), np.zeros((5, 2)), np.outer(np.arange(6.0), [1.0, 2.0])])
def test_points_on_a_line_have_no_hull(points: np.ndarray) -> None:
    assert len(hull_corners(points)) < 3

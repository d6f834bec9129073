from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.surface.projection import project

FloatArray = NDArray[np.float64]


def sphere(radius: float, count: int) -> np.ndarray:
    """Evenly spread unit vectors (Fibonacci) times `radius`."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    ring = np.sqrt(1 - z**2)
    return radius * np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])


def test_a_toe_is_smoothed_and_not_shrunk() -> None:
    exact = sphere(10.0, 2500)  # about 0.7 mm apart
    normals = exact / 10.0
    noisy = exact + normals * np.random.default_rng(0).normal(0, 0.1, (2500, 1))
    smooth = project(noisy, normals, noisy, normals, 1.2, 2.0).points
    deviation = np.linalg.norm(smooth, axis=1) - 10.0
    assert deviation.std() < 0.06
    # A mean or a plane would draw it in by about 3²/(8 * 10) = 0.11 mm.
    assert abs(deviation.mean()) < 0.01


def test_two_sheets_back_to_back_do_not_mix() -> None:
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    upper = np.column_stack([x.ravel(), y.ravel(), np.full(400, 1.0)])
    lower = upper * [1, 1, 0]
    cloud = np.concatenate([upper, lower])
    normals = np.concatenate([np.tile([0.0, 0.0, 1.0], (400, 1)), np.tile([0.0, 0.0, -1.0], (400, 1))])
    np.testing.assert_allclose(project(cloud, normals, cloud, normals, 1.5, 2.0).points, cloud, atol=1e-9)


def test_a_lonely_point_stays() -> None:
    point, up = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    stayed = project(point, up, point + np.array([100.0, 0, 0]), up, 1.5, 2.0)
    np.testing.assert_allclose(stayed.points, point)
    assert (stayed.gap_steps[0], stayed.sectors[0], stayed.nearest[0]) == (np.inf, 0, -1)


def striped(surface: Callable[[FloatArray, FloatArray], FloatArray], step: float) -> FloatArray:
    """Points (N, 3) of a surface over X and Y: stripes `step` mm apart, with points every 0.25 mm."""
    x, y = np.meshgrid(np.arange(-20.0, 20.1, step), np.arange(-10.0, 10.1, 0.25))
    return np.column_stack([x.ravel(), y.ravel(), surface(x, y).ravel()])


def test_a_toe_between_distant_stripes_keeps_its_form() -> None:
    """Where the stripes are 4 mm apart, a neighbourhood as wide along them would cover half of a toe of 8 mm."""
    angle, x = np.meshgrid(np.linspace(-np.pi, np.pi, 200, endpoint=False), np.arange(-20.0, 21.0, 4.0))
    normals = np.column_stack([np.zeros(x.size), np.sin(angle.ravel()), np.cos(angle.ravel())])
    stripes = 8.0 * normals + np.column_stack([x.ravel(), np.zeros((x.size, 2))])
    between = np.flatnonzero(np.abs(stripes[:, 0]) < 3.0)
    places = stripes[between] + np.array([2.0, 0.0, 0.0]) + 0.3 * normals[between]
    placed = project(places, normals[between], stripes, normals, 4.0, 1.75).points
    assert np.abs(np.hypot(placed[:, 1], placed[:, 2]) - 8.0).max() < 0.01


def test_a_cleft_is_no_surface() -> None:
    """Between two walls that both count as neighbours a fit runs through neither."""
    steep = np.radians(70.0)
    cleft = striped(lambda _, y: np.tan(steep) * np.abs(y), 2.0)
    lean = -np.sin(steep) * np.sign(cleft[:, 1])
    normals = np.column_stack([np.zeros(len(cleft)), lean, np.full(len(cleft), np.cos(steep))])
    up = np.array([[0.0, 0.0, 1.0]])
    placed = project(np.array([[1.0, 0.0, 0.5]]), up, cleft, normals, 2.0, 1.75, rounds=1)
    plane = striped(lambda _, y: 0.0 * y, 2.0)
    on_plane = project(np.array([[1.0, 0.0, 0.5]]), up, plane, np.repeat(up, len(plane), axis=0), 2.0, 1.75)
    assert placed.misfit_steps[0] > 0.1
    assert placed.points[0, :2].tolist() == [1.0, 0.0]  # moved along its own normal, to the mean of the walls
    assert 0.0 < placed.points[0, 2] < 3.0
    assert on_plane.misfit_steps[0] < 1e-6


def test_stripes_are_far_apart_across_and_dense_along() -> None:
    """On a steep flank the next stripe is far along the surface; beside the end of a stripe nothing is near."""
    slope = np.radians(60.0)
    flank = striped(lambda x, _: np.tan(slope) * x, 1.0)
    normal = np.array([[-np.sin(slope), 0.0, np.cos(slope)]])
    normals = np.repeat(normal, len(flank), axis=0)
    between = project(np.array([[0.5, 0.0, 0.5 * np.tan(slope)]]), normal, flank, normals, 1.0, 1.75)
    assert between.gap_steps[0] == pytest.approx(0.5, abs=0.01)  # 1 mm away, and 2 mm from stripe to stripe
    beside = project(np.array([[0.0, 11.0, 0.0]]), normal, flank, normals, 1.0, 1.75)
    assert beside.gap_steps[0] == pytest.approx(1.0, abs=0.01)

import numpy as np

from footscan.surface.projection import project


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

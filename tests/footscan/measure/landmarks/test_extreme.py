import numpy as np
import pytest

from footscan.measure.landmarks.extreme import height_at, saddle, summit

EVERYWHERE = ((-np.inf, np.inf), (-np.inf, np.inf))


def dome(spacing: float, radii: tuple[float, float] = (30.0, 12.0), noise: float = 0.0) -> np.ndarray:
    """A paraboloid of the height 50 at (3.3, -1.7), its curvature radii along X and Y, its vertices anywhere."""
    line = np.arange(-20, 20, spacing) + 0.37 * spacing
    x, y = (grid.ravel() for grid in np.meshgrid(line, line))
    z = 50 - x**2 / (2 * radii[0]) - y**2 / (2 * radii[1])
    z += np.random.default_rng(0).normal(0, noise, len(z))
    return np.column_stack([x + 3.3, y - 1.7, z])


@pytest.mark.parametrize("spacing", [1.0, 2.0, 3.0])
def test_the_summit_of_a_dome_lies_between_its_vertices(spacing: float) -> None:
    points = dome(spacing)
    top = summit(points, 2, 1, EVERYWHERE, 1.0)
    assert top is not None
    assert top.point == pytest.approx([3.3, -1.7, 50.0], abs=1e-5)
    assert not top.at_border
    nearest = points[np.argmax(points[:, 2])]
    assert np.abs(nearest - [3.3, -1.7, 50.0]).max() > 0.29 * spacing  # the farthest vertex would be far off


@pytest.mark.parametrize(("axis", "sign"), [(0, 1), (0, -1), (1, 1), (1, -1), (2, -1)])
def test_summits_in_all_directions(axis: int, sign: int) -> None:
    across = [k for k in range(3) if k != axis]
    points = np.empty_like(dome(1.0))
    points[:, [*across, axis]] = dome(1.0) * [1, 1, sign]
    top = summit(points, axis, sign, EVERYWHERE, 1.0)
    assert top is not None
    assert top.point[[*across, axis]] == pytest.approx([3.3, -1.7, sign * 50.0], abs=1e-6)


def test_noise_does_not_push_a_summit_out() -> None:
    top = summit(dome(1.0, noise=0.3), 2, 1, EVERYWHERE, 1.0)
    assert top is not None
    assert top.point[2] == pytest.approx(50.0, abs=0.15)  # the farthest vertex is 0.6 mm too far out
    assert top.point[:2] == pytest.approx([3.3, -1.7], abs=0.8)
    assert top.residual == pytest.approx(0.3, rel=0.25)
    assert dome(1.0, noise=0.3)[:, 2].max() > 50.5


def test_strays_do_not_count() -> None:
    strays = np.array([[10.0, 5.0, 56.0], [-8.0, 0.0, 58.0], [3.0, 9.0, 61.0]])
    top = summit(np.concatenate([dome(1.0), strays]), 2, 1, EVERYWHERE, 1.0)
    assert top is not None
    assert top.point == pytest.approx([3.3, -1.7, 50.0], abs=1e-3)


def test_a_window_that_the_summit_lies_outside_of() -> None:
    top = summit(dome(1.0), 2, 1, ((8.3, 20.0), (-np.inf, np.inf)), 1.0)
    assert top is not None
    assert top.point[[0, 2]] == pytest.approx([8.3, 50 - 25 / 60], abs=0.001)
    assert top.point[1] == pytest.approx(-1.7, abs=0.2)  # over which the dome falls by 0.002 mm
    assert top.at_border


def test_an_empty_window() -> None:
    assert summit(dome(1.0), 2, 1, ((100.0, 120.0), (-np.inf, np.inf)), 1.0) is None
    assert summit(np.zeros((0, 3)), 2, 1, EVERYWHERE, 1.0) is None


def test_the_middle_of_a_blunt_end() -> None:
    points = dome(1.0)
    x, y = points[:, 0] - 3.3, points[:, 1] + 1.7
    points[:, 2] = 50 - 2 * ((x / 6) ** 4 + (y / 6) ** 4)
    top = summit(points, 2, 1, EVERYWHERE, 1.0)
    assert top is not None
    assert top.point == pytest.approx([3.3, -1.7, 50.0], abs=0.1)


def test_a_saddle() -> None:
    position = dome(1.0)[:, :2]
    x, y = position.T
    height = 7 + (x - 1.2) ** 2 / 40 - (y + 0.6) ** 2 / 25
    top = saddle(position, height, np.array([4.0, 2.0]), 8.0)
    assert top is not None
    assert top[0] == pytest.approx([1.2, -0.6], abs=1e-3)
    assert top[1] == pytest.approx(7.0, abs=1e-4)


def test_the_height_at_a_place() -> None:
    points = dome(2.0)
    assert height_at(points[:, :2], points[:, 2], np.array([8.0, 1.0]), 8.0) == pytest.approx(
        50 - 4.7**2 / 60 - 2.7**2 / 24, abs=1e-4
    )
    assert height_at(points[:, :2], points[:, 2], np.array([200.0, 0.0]), 8.0) is None

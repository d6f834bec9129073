"""Refraction and reflection of the plate against values worked out by hand."""

import numpy as np
import pytest

from footscan.virtual.optics.glass import directions_from_below, exits_above, reflectance, sine_from_below

SOURCE = np.array([0.0, 0.0, -106.0])


def test_path_obeys_snells_law() -> None:
    # 30 degrees in air, sin = 0.5: in glass sin = 0.5 / 1.52, tan = 0.3483327. 100 mm of air below, 50 mm above.
    distance = 150.0 * 0.57735027 + 6.0 * 0.34833269
    sine = sine_from_below(SOURCE, np.array([[distance, 0.0, 50.0], [0.0, distance, 50.0], [0.0, 0.0, 50.0]]))
    np.testing.assert_allclose(sine, [0.5, 0.5, 0.0], atol=1e-7)


def test_a_ghost_crosses_the_plate_three_times() -> None:
    distance = 150.0 * 0.57735027 + 18.0 * 0.34833269
    assert sine_from_below(SOURCE, np.array([[distance, 0.0, 50.0]]), passes=3)[0] == pytest.approx(0.5, abs=1e-7)


@pytest.mark.parametrize("passes", [1, 3])
def test_rays_lead_back_to_their_points(passes: int) -> None:
    random = np.random.default_rng(1)
    points = random.uniform([-150.0, -150.0, 0.0], [150.0, 150.0, 114.0], (200, 3))
    directions = directions_from_below(SOURCE, points, passes)
    exits = exits_above(SOURCE, directions, passes)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    arrived = exits + directions * (points[:, 2] / directions[:, 2])[:, None]
    np.testing.assert_allclose(arrived, points, atol=1e-9)


def test_reflectance_of_one_face() -> None:
    # Upright ((n - 1) / (n + 1))^2; at Brewster's angle, tan = n, half of ((n^2 - 1) / (n^2 + 1))^2; grazing all.
    brewster = 1.0 / np.sqrt(1.0 + 1.52**2)
    np.testing.assert_allclose(reflectance(np.array([1.0, brewster, 0.0])), [0.042580, 0.078345, 1.0], atol=1e-6)

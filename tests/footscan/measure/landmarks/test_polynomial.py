import numpy as np
import pytest

from footscan.measure.landmarks.polynomial import climb, robust_fit, slope, terms_at

FACTORS = np.array([5.0, 0.3, -0.2, -1.0, 0.4, -0.8, 0.1, 0.05, -0.02, 0.03, 0.01, 0.0, 0.02, 0.0, -0.01])
UNHELD = 1e6
"""Unevenness that holds nothing back."""


def grid() -> np.ndarray:
    u, v = np.meshgrid(np.linspace(-1, 1, 31), np.linspace(-1, 1, 31))
    return np.column_stack([u.ravel(), v.ravel()])


def test_a_term_of_each_power() -> None:
    terms = terms_at(np.array([[2.0, 3.0]]))[0]
    assert terms.tolist() == [1, 2, 3, 4, 6, 9, 8, 12, 18, 27, 16, 24, 36, 54, 81]


def test_a_polynomial_is_found_again() -> None:
    factors, noise = robust_fit(grid(), terms_at(grid()) @ FACTORS, 0.0, UNHELD)
    np.testing.assert_allclose(factors, FACTORS, atol=1e-6)
    assert noise == 0.01  # the least


def test_points_off_the_surface_do_not_count() -> None:
    height = terms_at(grid()) @ FACTORS
    height[::17] += 3.0
    factors, _ = robust_fit(grid(), height, 0.0, UNHELD)
    np.testing.assert_allclose(factors, FACTORS, atol=1e-6)


def test_noise_is_told_and_may_not_bend() -> None:
    height = terms_at(grid())[:, :6] @ FACTORS[:6] + np.random.default_rng(0).normal(0, 0.3, len(grid()))
    free, noise = robust_fit(grid(), height, 0.3, UNHELD)
    held, _ = robust_fit(grid(), height, 0.3, 0.02)
    assert noise == pytest.approx(0.3, rel=0.1)
    assert np.abs(held[6:]).max() < 0.3 * np.abs(free[6:]).max()


def test_too_few_points() -> None:
    assert robust_fit(grid()[:5], np.zeros(5), 0.0, UNHELD)[1] == -1.0


def test_derivatives() -> None:
    place, step = np.array([0.3, -0.4]), 1e-4

    def value(du: float, dv: float) -> float:
        return float((terms_at((place + np.array([du, dv]))[None]) @ FACTORS)[0])

    gradient, second = slope(FACTORS, place)
    along = [value(step, 0) - value(-step, 0), value(0, step) - value(0, -step)]
    np.testing.assert_allclose(gradient, np.array(along) / (2 * step), atol=1e-6)
    assert second[0, 0] == pytest.approx((value(step, 0) - 2 * value(0, 0) + value(-step, 0)) / step**2, abs=1e-4)
    mixed = value(step, step) - value(step, -step) - value(-step, step) + value(-step, -step)
    assert second[0, 1] == second[1, 0] == pytest.approx(mixed / (4 * step**2), abs=1e-4)


def test_the_summit_is_level() -> None:
    dome = np.array([5.0, 0.1, -0.2, -1.0, 0.2, -0.8, *np.zeros(9)])
    summit = climb(dome, np.zeros(2))
    np.testing.assert_allclose(slope(dome, summit)[0], 0.0, atol=1e-9)


def test_without_a_summit_the_place_stays() -> None:
    saddle = np.array([0.0, 0.1, 0.0, -1.0, 0.0, 1.0, *np.zeros(9)])
    assert climb(saddle, np.array([0.2, 0.1])).tolist() == [0.2, 0.1]

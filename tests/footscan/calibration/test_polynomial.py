"""Values of polynomials and their region, against numbers worked out by hand."""

import doctest

import numpy as np
import pytest

from footscan.calibration import polynomial
from footscan.calibration.polynomial import design_matrix, evaluate, supported, terms
from schemas.calibration import Point, PolynomialCamera


def camera(order: int, region: list[Point] | None = None, **changes: object) -> PolynomialCamera:
    count = terms(order)
    fields = {
        "camera": 1,
        "order": order,
        "centre_px": (0.0, 0.0),
        "scale_px": 1.0,
        "alpha_y": [0.0] * count,
        "alpha_z": [0.0] * count,
        "region_px": region or [],
        "points": 0,
        **changes,
    }
    return PolynomialCamera.model_validate(fields)


def test_examples() -> None:
    assert doctest.testmod(polynomial).failed == 0


def test_terms_of_third_order() -> None:
    # u = 2, v = 5: u^3 = 8, u^2 v = 20, u v^2 = 50, v^3 = 125
    np.testing.assert_array_equal(design_matrix([2.0], [5.0], 3), [[1, 2, 5, 4, 10, 25, 8, 20, 50, 125]])


def test_evaluate_by_hand() -> None:
    model = camera(
        2, centre_px=(10.0, 20.0), scale_px=5.0, alpha_y=[1, 2, 3, 4, 5, 6], alpha_z=[0.5, 0.0, -1.0, 0.0, 0.0, 2.0]
    )
    # (20, 15): u = 2, v = -1: Y = 1 + 4 - 3 + 16 - 10 + 6 = 14, Z = 0.5 + 1 + 2 = 3.5; the centre: the constants
    world = evaluate(model, np.array([[20, 15], [10, 20]], np.float32))
    np.testing.assert_allclose(world, [[14, 3.5], [1, 0.5]])


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
def test_evaluate_is_the_design_matrix_times_alpha(order: int) -> None:
    generator = np.random.default_rng(order)
    alpha = generator.normal(size=(2, terms(order)))
    model = camera(order, centre_px=(320.0, 240.0), scale_px=300.0, alpha_y=list(alpha[0]), alpha_z=list(alpha[1]))
    pixels = generator.uniform(0, 640, (1000, 2))
    u, v = (pixels[:, 0] - 320) / 300, (pixels[:, 1] - 240) / 300
    np.testing.assert_allclose(evaluate(model, pixels), design_matrix(u, v, order) @ alpha.T, rtol=1e-12, atol=1e-12)


def test_no_pixels() -> None:
    model = camera(1, [(0, 0), (4, 0), (0, 4)])
    assert evaluate(model, np.empty((0, 2))).shape == (0, 2)
    assert supported(model, np.empty((0, 2))).shape == (0,)


@pytest.mark.parametrize("turned", [False, True])
def test_supported_by_a_triangle(turned: bool) -> None:
    corners: list[Point] = [(0, 0), (4, 0), (0, 4)]
    model = camera(1, corners[::-1] if turned else corners)
    pixels = np.array([[1, 1], [0, 0], [4, 0], [2, 2], [2.1, 2.1], [-0.1, 1], [1, -1], [np.nan, 1]])
    assert supported(model, pixels).tolist() == [True, True, True, True, False, False, False, False]
    # (2.1, 2.1) is 0.1 sqrt(2) = 0.141 px beyond the long side, (1, -1) is 1 px beyond another
    assert supported(model, pixels, 0.15).tolist() == [True, True, True, True, True, True, False, False]


def test_unknown_region_supports_all() -> None:
    assert supported(camera(1), np.array([[1e6, -5.0]])).tolist() == [True]

"""Polynomials of the pixel and their derivatives, against numbers worked out by hand and finite differences."""

import numpy as np
import pytest

from footscan.calibration.models.polynomial import PolynomialModel, derivatives, design_matrix, terms

ORDERS = [1, 2, 3, 4, 5]


def test_terms_of_third_order() -> None:
    # u = 2, v = 5: u^3 = 8, u^2 v = 20, u v^2 = 50, v^3 = 125
    np.testing.assert_array_equal(design_matrix([2.0], [5.0], 3), [[1, 2, 5, 4, 10, 25, 8, 20, 50, 125]])


def test_derivatives_of_third_order() -> None:
    # by u at (2, 5): 3 u^2 = 12, 2 u v = 20, v^2 = 25, 0; by v: 0, u^2 = 4, 2 u v = 20, 3 v^2 = 75
    by_u, by_v = derivatives([2.0], [5.0], 3)
    np.testing.assert_array_equal(by_u, [[0, 1, 0, 4, 5, 0, 12, 20, 25, 0]])
    np.testing.assert_array_equal(by_v, [[0, 0, 1, 0, 2, 10, 0, 4, 20, 75]])


def test_world_by_hand() -> None:
    model = PolynomialModel(2, (10.0, 20.0), 5.0)
    parameters = np.array([1, 2, 3, 4, 5, 6, 0.5, 0.0, -1.0, 0.0, 0.0, 2.0])
    # (20, 15): u = 2, v = -1: Y = 1 + 4 - 3 + 16 - 10 + 6 = 14, Z = 0.5 + 1 + 2 = 3.5; the centre: the constants
    world = model.world(parameters, np.array([[20.0, 15.0], [10.0, 20.0]]))
    np.testing.assert_allclose(world, [[14, 3.5], [1, 0.5]], rtol=1e-15)


@pytest.mark.parametrize("order", ORDERS)
def test_parameters_are_linear(order: int) -> None:
    model = PolynomialModel(order, (320.0, 240.0), 300.0)
    generator = np.random.default_rng(order)
    parameters, pixels = generator.normal(size=model.unknowns), generator.uniform(0, 480, (50, 2))
    assert model.unknowns == 2 * terms(order)
    world = model.by_parameters(parameters, pixels) @ parameters
    np.testing.assert_allclose(world, model.world(parameters, pixels), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("order", ORDERS)
def test_slope_is_that_of_finite_differences(order: int) -> None:
    model = PolynomialModel(order, (320.0, 240.0), 300.0)
    generator = np.random.default_rng(order)
    parameters, pixels = 50 * generator.normal(size=model.unknowns), generator.uniform(0, 480, (50, 2))
    for axis in (0, 1):
        step = 1e-2 * np.eye(2)[axis]
        slope = (model.world(parameters, pixels + step) - model.world(parameters, pixels - step)) / 2e-2
        np.testing.assert_allclose(model.by_pixels(parameters, pixels)[:, :, axis], slope, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("order", ORDERS)
def test_goes_into_the_file_as_it_is(order: int) -> None:
    model = PolynomialModel(order, (320.0, 240.0), 300.0)
    parameters = np.arange(float(model.unknowns))
    written = model.as_map(parameters)
    assert (written.order, written.centre_px, written.scale_px) == (order, (320.0, 240.0), 300.0)
    assert written.alpha_y + written.alpha_z == parameters.tolist()


def test_no_pixels() -> None:
    model, none = PolynomialModel(1, (0.0, 0.0), 1.0), np.empty((0, 2))
    assert model.world(np.zeros(6), none).shape == (0, 2)
    assert model.by_pixels(np.zeros(6), none).shape == (0, 2, 2)
    assert model.by_parameters(np.zeros(6), none).shape == (0, 2, 6)

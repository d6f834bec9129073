"""Arithmetic that comes out alike on every processor, beside the libraries that are more exact or more general."""

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from footscan.virtual.portable import cos_sin, dot, exp, gaussian_blur, gaussian_kernel, product


def test_exp_is_good_to_two_units_in_the_last_place() -> None:
    x = np.concatenate(
        [np.random.default_rng(1).uniform(-700.0, 700.0, 20_000), [0.0, -0.0, 1e-300, math.log(2.0) / 2]]
    )
    exact = np.array([math.exp(value) for value in x])
    assert np.all(np.abs(exp(x) - exact) <= 2.0 * np.spacing(exact))


def test_exp_of_what_is_too_small_is_zero() -> None:
    assert exp(np.array([-709.0, -1e300, -np.inf])).tolist() == [0.0, 0.0, 0.0]


def test_exp_keeps_the_shape() -> None:
    assert exp(np.zeros((2, 0, 3))).shape == (2, 0, 3)
    assert exp(np.array(1.0)).shape == ()


def test_a_kernel_sums_to_one() -> None:
    kernel = gaussian_kernel(1.3, 4)
    assert kernel.shape == (9,)
    assert kernel.sum() == pytest.approx(1.0, abs=1e-15)
    assert kernel[4] / kernel[5] == pytest.approx(math.exp(0.5 / 1.3**2))


@pytest.mark.parametrize("mode", ["reflect", "constant", "wrap"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_blur_is_that_of_scipy(mode: str, dtype: type) -> None:
    picture = np.random.default_rng(2).normal(size=(30, 41)).astype(dtype)
    blurred = gaussian_blur(picture, 2.2, truncate=3.0, mode=mode)
    assert blurred.dtype == dtype
    np.testing.assert_allclose(blurred, gaussian_filter(picture, 2.2, truncate=3.0, mode=mode), rtol=0, atol=1e-6)


def test_a_blur_by_nothing_is_the_picture() -> None:
    picture = np.eye(3)
    assert np.array_equal(gaussian_blur(picture, 0.0), picture)


def test_products_are_those_of_matrices() -> None:
    random = np.random.default_rng(3)
    vectors, matrix = random.normal(size=(50, 3)), random.normal(size=(3, 4))
    np.testing.assert_allclose(product(vectors, matrix), vectors @ matrix, atol=1e-14)
    np.testing.assert_allclose(dot(vectors, matrix[:, 1]), vectors @ matrix[:, 1], atol=1e-14)


def test_cos_sin() -> None:
    assert cos_sin(30.0) == pytest.approx((math.sqrt(0.75), 0.5))

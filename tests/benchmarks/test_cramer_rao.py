"""The bound against closed forms, and against the spread of maximum-likelihood estimates on simulated profiles."""

import importlib
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.ndimage import gaussian_filter
from scipy.optimize import minimize
from scipy.stats import norm

from footscan.frames.image import decode_image
from footscan.virtual.optics.sensor import compress, photograph
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]

TRIALS = 600
SPREAD_ERROR = 1.0 / math.sqrt(2 * TRIALS)
"""Relative standard error of a standard deviation of so many values."""


@pytest.fixture(scope="module")
def bound() -> Iterator[Any]:
    """The module; benchmarks are no installed package."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(Path(__file__).parents[2])
        yield importlib.import_module("benchmarks.cramer_rao")


@pytest.fixture(scope="module")
def plain(bound: Any) -> Any:
    """A red sensor with read noise alone."""
    return bound.Webcam(electrons=math.inf, read_noise=0.01, grain_px=0.0, mosaic=False, jpeg_quality=None)


@pytest.mark.parametrize("sigma", [1.5, 2.5, 4.0])
def test_white_noise_has_a_closed_form(bound: Any, plain: Any, sigma: float) -> None:
    """The integral of (A x / sigma^2 exp(-x^2 / 2 sigma^2))^2 is A^2 sqrt(pi) / 2 sigma."""
    variance = 2 * sigma * 0.01**2 / (0.6**2 * math.sqrt(math.pi))
    assert bound.centre_bound(sigma, 0.6, 0.1, 0.0, webcam=plain) == pytest.approx(math.sqrt(variance), rel=1e-3)


def test_a_mosaic_measures_each_colour_in_its_share_of_pixels(bound: Any) -> None:
    """White noise: information is the sum over colours of share times amplitude squared: 1/4, 1/2, 1/4."""
    webcam = bound.Webcam(electrons=math.inf, read_noise=0.01, jpeg_quality=None)
    squares = 0.25 * 1.0**2 + 0.5 * 0.12**2 + 0.25 * 0.09**2
    variance = 2 * 2.5 * 0.01**2 / (0.6**2 * math.sqrt(math.pi) * squares)
    found = bound.centre_bound(2.5, 0.6, 0.1, 0.0, webcam=webcam)
    assert found == pytest.approx(math.sqrt(variance), rel=1e-3)


def test_shot_noise_has_a_closed_form(bound: Any) -> None:
    """N electrons in a Gaussian: the variance of its centre is sigma^2 / N, but for the noise's own dependence.

    That adds to each pixel half of (m'/m)^2, in all 1/2 the sum of x^2 / sigma^4: of order 1 / electrons in a pixel,
    which is small here.
    """
    webcam = bound.Webcam(electrons=1e9, read_noise=1e-7, mosaic=False, jpeg_quality=None)
    electrons = 0.6e9 * math.sqrt(2 * math.pi) * 2.5
    found = bound.centre_bound(2.5, 0.6, 0.0, 0.0, webcam=webcam)
    assert found == pytest.approx(2.5 / math.sqrt(electrons), rel=2e-3)


def test_a_stretch_without_common_noise_counts_by_its_length(bound: Any, plain: Any) -> None:
    one, nine = (bound.centre_bound(2.5, 0.6, 0.1, 0.12, along, webcam=plain) for along in (1, 9))
    assert nine == pytest.approx(one / 3, rel=1e-6)


def test_correlated_speckle_counts_for_less(bound: Any) -> None:
    """Neighbours in a direction have 0.357 in common: the kernel is 0.191, 1, 0.191 and a little beyond."""
    correlation = bound.grain_correlation(0.55, 4)
    assert correlation[:2] == pytest.approx([1.0, (2 * 0.19151 + 2 * 0.19151 * 0.00134) / 1.07335], abs=1e-4)
    one, nine = (bound.centre_bound(2.5, 0.6, 0.1, 0.12, along) for along in (1, 9))
    assert one / 3 < nine < one


def test_light_above_white_tells_nothing(bound: Any) -> None:
    """Two flanks where light is below white are left: with white noise, of the integral that much and no more.

    The integral of x^2 exp(-x^2 / sigma^2) beyond t sigma is sigma^3 (t exp(-t^2) / 2 + sqrt(pi) erfc(t) / 4).
    """
    webcam = bound.Webcam(electrons=math.inf, read_noise=1e-4, grain_px=0.0, mosaic=False, jpeg_quality=None)
    sigma, peak = 20.0, 5.0  # many pixels, so that the place of the cut among them does not count
    cut = math.sqrt(2 * math.log(peak))
    flanks = 2 * sigma**3 * (cut * math.exp(-(cut**2)) / 2 + math.sqrt(math.pi) * math.erfc(cut) / 4)
    expected = 1e-4 * sigma**2 / (peak * math.sqrt(flanks))
    assert bound.centre_bound(sigma, peak, 0.0, 0.0, webcam=webcam) == pytest.approx(expected, rel=0.02)
    assert bound.centre_bound(2.5, 0.6, 1.5, 0.0, webcam=bound.WEBCAM) > 0.5  # the leaks alone


def test_compression_costs_and_the_best_hardly_any(bound: Any) -> None:
    stripe = bound.Stripe(2.5, 0.6, 0.1, 0.12)
    worse, usual, best = (bound.compression_noise(stripe, quality) for quality in (50, 85, 100))
    assert (best == 1 / 12).all()
    assert (usual > 1.0).all()
    assert (usual < 5**2).all()  # no more than the finest step of the quantisation of colour
    assert (worse > usual).all()
    uncompressed = bound.centre_bound(2.5, 0.6, 0.1, 0.12, webcam=bound.Webcam(jpeg_quality=None))
    assert uncompressed < bound.centre_bound(2.5, 0.6, 0.1, 0.12)


@pytest.mark.slow
def test_estimates_reach_the_bound_in_correlated_speckle(bound: Any) -> None:
    """One column of a red sensor."""
    webcam = bound.Webcam(mosaic=False, jpeg_quality=None)
    row = np.arange(-9, 10)
    kernel = np.exp(-0.5 * (np.arange(-6, 7) / 0.55) ** 2)
    lags = np.pad(np.convolve(kernel, kernel)[12:], (0, 10))
    common = (lags / lags[0])[abs(row[:, None] - row)]

    def moments(unknown: Floats) -> tuple[Floats, Floats]:
        centre, sigma, peak, base = unknown
        line = peak * np.exp(-0.5 * ((row - centre) / sigma) ** 2)
        mean = line + base
        return mean, 0.12**2 * common * np.outer(line, line) + np.diag(np.abs(mean) / 6000.0 + 0.0012**2)

    def cost(unknown: Floats, seen: Floats) -> float:
        mean, covariance = moments(unknown)
        factor = np.linalg.cholesky(covariance)
        return float(np.sum(solve_triangular(factor, seen - mean, lower=True) ** 2) / 2 + np.log(np.diag(factor)).sum())

    def simulate(unknown: Floats, random: np.random.Generator) -> Floats:
        mean, covariance = moments(unknown)
        return np.asarray(random.multivariate_normal(mean, covariance))

    spread = _spread(simulate, cost, np.array([0.0, 2.0, 0.5, 0.1]))
    expected = bound.centre_bound(2.0, 0.5, 0.1, 0.12, webcam=webcam)
    assert expected * (1 - 3 * SPREAD_ERROR) <= spread <= 1.15 * expected


@pytest.mark.slow
def test_estimates_reach_the_bound_where_white_cuts_the_stripe(bound: Any) -> None:
    """One column of a red sensor with speckle that is independent from pixel to pixel."""
    webcam = bound.Webcam(grain_px=0.0, mosaic=False, jpeg_quality=None)
    row = np.arange(-18, 19)

    def moments(unknown: Floats) -> tuple[Floats, Floats]:
        centre, sigma, peak, base = unknown
        line = peak * np.exp(-0.5 * ((row - centre) / sigma) ** 2)
        return line + base, np.sqrt((0.12 * line) ** 2 + np.abs(line + base) / 6000.0 + 0.0012**2)

    def cost(unknown: Floats, seen: Floats) -> float:
        mean, deviation = moments(unknown)
        white = norm.logsf(1.0, mean, deviation)
        return -float(np.where(seen >= 1.0, white, norm.logpdf(seen, mean, deviation)).sum())

    def simulate(unknown: Floats, random: np.random.Generator) -> Floats:
        return np.asarray(np.minimum(random.normal(*moments(unknown)), 1.0))

    spread = _spread(simulate, cost, np.array([0.0, 2.5, 24.0, 0.1]))
    expected = bound.centre_bound(2.5, 24.0, 0.1, 0.12, webcam=webcam)
    assert expected * (1 - 3 * SPREAD_ERROR) <= spread <= 1.15 * expected


@pytest.mark.parametrize("peak", [0.6, 24.0])
def test_the_virtual_camera_keeps_the_bound(bound: Any, peak: float) -> None:
    """Nine columns of its JPEG pictures, read by the best linear estimate there is: a regression on many pictures.

    They show at most thirteen columns of the sensor, and hardly less than nine.
    """
    middle, reach = 31.3, 13
    random = np.random.default_rng(5)
    rows = np.arange(64)[:, None]
    pixels, offsets = [], random.uniform(-0.2, 0.2, 240)
    for offset in offsets:
        line = peak * np.exp(-0.5 * ((rows - middle - offset) / 2.5) ** 2)
        grain = gaussian_filter(random.standard_normal((64, 640)), 0.55)
        laser = line * (1.0 + 0.12 * grain / grain.std())
        light = laser[..., None] * [1.0, 0.12, 0.09] + 0.1 * bound.ROOM_COLOUR
        picture = photograph(light.astype(np.float32), random, SimulationSettings())
        seen = decode_image(compress(picture, SimulationSettings()))[31 - reach : 32 + reach]
        pixels.append([seen[:, column : column + 9].ravel() for column in range(19, 611, 16)])
    known, asked = np.split(np.array(pixels, np.float64), [160])
    per_picture = known.shape[1]
    mean = known.mean(axis=(0, 1))
    known, asked = (known - mean).reshape(-1, len(mean)), (asked - mean).reshape(-1, len(mean))
    ridge = 1e-4 * np.square(known).sum() / len(mean) * np.eye(len(mean))
    found = asked @ np.linalg.solve(known.T @ known + ridge, known.T @ np.repeat(offsets[:160], per_picture))
    true = np.repeat(offsets[160:], per_picture)
    unbiased = found / (found @ true / (true @ true))
    spread = np.std(unbiased - true)
    thirteen, nine = (bound.centre_bound(2.5, peak, 0.1, 0.12, along) for along in (13, 9))
    assert thirteen < spread < 1.05 * nine


def _spread(
    simulate: Callable[[Floats, np.random.Generator], Floats], cost: Callable[[Floats, Floats], float], true: Floats
) -> float:
    """Root mean square error of the centre that maximises the likelihood, centres being spread over two pixels."""
    random = np.random.default_rng(3)
    errors = []
    for centre in random.uniform(-1.0, 1.0, TRIALS):
        unknown = true + np.array([centre, 0.0, 0.0, 0.0])
        seen = simulate(unknown, random)

        def relative(change: Floats, unknown: Floats = unknown, seen: Floats = seen) -> float:
            return cost(unknown + change * np.array([0.1, *(0.1 * true[1:])]), seen)

        errors.append(0.1 * minimize(relative, np.zeros(4), method="BFGS").x[0])
    return float(np.sqrt(np.mean(np.square(errors))))

"""Centres of profiles that are symmetric about a known place, and of one worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from footscan.stripe.centre import centre_of
from footscan.stripe.loop_parameters import METHODS, LoopParameters

MIDDLE = 20
X = np.arange(2 * MIDDLE + 1.0)
FRACTIONS = [-0.5, -0.3, -0.1, 0.0, 0.2, 0.4, 0.5]
EXACT = [name for name in METHODS if name != "threshold-median"]


def centre(samples, method, level=0.5, clipped=None, first=0, last=2 * MIDDLE, base=0.0):
    """By `method`; half height is met where straight lines between the samples do so."""
    samples = np.asarray(samples, float)
    contrast = samples.max() - base
    half = base + 0.5 * contrast
    above = np.flatnonzero(samples > half)
    a, b = above[0], above[-1]
    left = a - (samples[a] - half) / (samples[a] - samples[a - 1])
    right = b + (samples[b] - half) / (samples[b] - samples[b + 1])
    limits = LoopParameters(18, 250, 4.0, 40.0, level, METHODS.index(method))
    clipped = np.zeros(len(samples), np.bool_) if clipped is None else clipped
    return centre_of(samples, clipped, first, last, left, right, base, contrast, limits)


def gaussian(fraction, sigma=2.5, height=200.0):
    return height * np.exp(-0.5 * ((X - MIDDLE - fraction) / sigma) ** 2)


@pytest.mark.parametrize("fraction", FRACTIONS)
@pytest.mark.parametrize("sigma", [1.5, 2.5, 4.0])
@pytest.mark.parametrize(
    ("method", "limit"),
    [("gravity", 0.005), ("gaussian", 1e-9), ("ridge", 2e-4), ("fir", 0.008), ("threshold-median", 0.5)],
)
def test_a_gaussian_profile(method, limit, sigma, fraction):
    assert centre(gaussian(fraction, sigma), method) == pytest.approx(MIDDLE + fraction, abs=limit)


@pytest.mark.parametrize("method", METHODS)
def test_a_profile_even_about_a_sample_or_midway_has_its_centre_there(method):
    for fraction in (0.0, 0.5):
        assert centre(gaussian(fraction), method) == pytest.approx(MIDDLE + fraction, abs=1e-6)


@pytest.mark.parametrize("fraction", FRACTIONS)
@pytest.mark.parametrize(
    ("method", "height", "limit"),
    [
        ("gravity", 400.0, 0.03),
        ("gaussian", 400.0, 1e-9),
        ("ridge", 400.0, 0.02),
        ("fir", 400.0, 0.02),
        ("threshold-median", 400.0, 0.5),
        # flanks so steep that half height lies between samples that are hardly lit and clipped
        ("gravity", 1500.0, 0.09),
        ("gaussian", 1500.0, 0.09),
        ("ridge", 1500.0, 0.045),
        ("fir", 1500.0, 0.045),
        ("threshold-median", 1500.0, 0.5),
        ("ridge", 5000.0, 0.04),
        ("fir", 5000.0, 0.04),
    ],
)
def test_a_clipped_profile_has_its_centre_in_its_flanks(method, height, limit, fraction):
    samples = np.minimum(gaussian(fraction, height=height), 255)
    assert centre(samples, method, clipped=samples >= 250) == pytest.approx(MIDDLE + fraction, abs=limit)


def test_threshold_median_by_hand():
    # above half of 100: samples 11 to 14; their median is 12.5, wherever between the samples half height is met
    samples = np.zeros(41)
    samples[10:16] = [40, 60, 100, 90, 51, 49]
    assert centre(samples, "threshold-median") == 12.5
    samples[11], samples[14] = 99, 90
    assert centre(samples, "threshold-median") == 12.5
    samples[15] = 51
    assert centre(samples, "threshold-median") == 13


def test_gravity_by_hand():
    # Levels 0 40 80 60 0 at 10 to 14; above a quarter of 80 the polygon runs from (10.5, 0) over (11, 20), (12, 60) and
    # (13, 40) to (13 + 2/3, 0). Areas 5, 40, 50, 40/3; the centroid of a trapezoid lies by its longer side.
    samples = np.zeros(41)
    samples[11:14] = [40, 80, 60]
    areas = np.array([5, 40, 50, 40 / 3])
    middles = np.array([10.5 + 0.5 * 2 / 3, 11 + (20 + 2 * 60) / (3 * 80), 12 + (60 + 2 * 40) / (3 * 100), 13 + 2 / 9])
    assert centre(samples, "gravity", level=0.25) == pytest.approx(areas @ middles / areas.sum(), abs=1e-12)


def test_gravity_leaves_out_what_lies_below_its_level_on_the_higher_side():
    # a background of 40 on the left: a triangle of 80 above it, of which the upper half is symmetric
    samples = np.maximum(np.where(X < MIDDLE, 40, 0), 120 - 30 * np.abs(X - MIDDLE))
    assert centre(samples, "gravity", base=40.0) == pytest.approx(MIDDLE, abs=1e-12)


def test_fir_by_hand():
    # half height of 90 is met at 10.5 and 13.5 (boxes of 3): at 11 the boxes hold 0 and 200, at 12 135 and 110 ...
    samples = np.zeros(41)
    samples[11:14] = [90, 90, 20]
    left, right = 10.5, 12 + 45 / 70
    assert math.ceil(right - left) == 3
    at_11 = 0 - (90 + 20 + 0)
    at_12 = (90 + 0 + 0) - 20
    assert centre(samples, "fir") == pytest.approx(11 - at_11 / (at_12 - at_11))


def test_gaussian_leaves_saturated_samples_out():
    samples = gaussian(0.3, height=200.0)
    clipped = np.abs(X - MIDDLE) <= 1
    torn = np.where(clipped, 200.0, samples)  # what is saturated has lost its shape
    assert centre(torn, "gaussian", clipped=clipped) == pytest.approx(MIDDLE + 0.3, abs=1e-9)
    assert abs(centre(torn, "gaussian") - MIDDLE - 0.3) > 0.01


def test_a_gaussian_of_too_few_samples_is_a_centre_of_gravity():
    samples = gaussian(0.3, sigma=1.5)
    clipped = np.abs(X - MIDDLE) <= 1
    assert centre(samples, "gaussian", clipped=clipped) == centre(samples, "gravity", clipped=clipped)


def test_where_a_method_finds_nothing():
    # the first derivative has no room beside a stripe at the very end of its profile
    assert math.isnan(centre(gaussian(0.0), "ridge", first=19, last=21))
    assert math.isnan(centre(gaussian(0.0), "fir", first=20, last=22))


PROFILES = st.tuples(
    st.floats(-0.5, 0.5), st.floats(1.2, 4.0), st.lists(st.integers(0, 20), min_size=41, max_size=41)
).map(lambda drawn: gaussian(drawn[0], drawn[1]) + drawn[2])


@settings(max_examples=60, deadline=None)
@given(PROFILES, st.sampled_from(METHODS))
def test_the_mirrored_profile_has_the_mirrored_centre(samples, method):
    one, other = centre(samples, method, base=20.0), centre(samples[::-1], method, base=20.0)
    assert one == pytest.approx(2 * MIDDLE - other, abs=2e-3)  # ridge stops at steps of 1e-3


@settings(max_examples=60, deadline=None)
@given(PROFILES, st.sampled_from(METHODS), st.floats(0.1, 10.0))
def test_brightness_moves_no_centre(samples, method, factor):
    bright = centre(factor * samples, method, base=factor * 20)
    assert bright == pytest.approx(centre(samples, method, base=20.0), abs=1e-6)


@pytest.mark.parametrize("method", EXACT)
def test_noise_moves_the_centre_in_proportion(method):
    """Against the least that any unbiased method can have: sigma_x^2 = noise^2 / sum of squared slopes (Cramer-Rao)."""
    generator = np.random.default_rng(5)
    slopes = np.gradient(gaussian(0.0))
    bound = 2.0 / np.sqrt(np.sum(slopes**2))
    noise = generator.normal(0, 2.0, (400, 41))
    errors = [centre(gaussian(0.0) + error, method, base=4.0) - MIDDLE for error in noise]
    assert bound * 0.9 < np.std(errors) < {"gravity": 1.3, "gaussian": 1.15, "ridge": 1.1, "fir": 1.2}[method] * bound
    assert abs(np.mean(errors)) < 0.005

"""Ridges of stripes whose centre and normal are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from footscan.stripe.loop_parameters import LoopParameters
from footscan.stripe.redness import as_words, halve
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, RADIUS, SHARPNESS, TAPS, I, J, find_ridges, gaussian

LIMITS = LoopParameters(red_threshold=18, saturation=245, faintest=4.0, largest_width=40.0, centre_level=0.5, method=1)
SHAPE = ROWS, COLUMNS = 140, 180
MIDDLE_I, MIDDLE_J = 90.2, 70.3
ALONG_J, ALONG_I = np.mgrid[0:ROWS, 0:COLUMNS].astype(float)


def ridges_of(image, capacity=4000, limits=LIMITS):
    rows, columns = image.shape[:2]
    half = -(-rows // 2), -(-columns // 2)
    excess, signal = np.empty(half, np.uint16), np.empty(half, np.uint16)
    halve(as_words(image), limits.saturation, excess, signal)
    ridges = np.full((capacity, 5), np.nan)
    count = find_ridges(excess, signal, gaussian(1.0), limits, ridges)
    return ridges[:count] if count <= capacity else count


def coloured(light, colour=(1.0, 0.1, 0.1), ambient=10.0):
    return np.clip(np.rint(light[..., np.newaxis] * colour + ambient), 0, 255).astype(np.uint8)


def stripe(degrees, offset=0.0, sigma=2.5, height=180.0):
    """Light of a straight stripe; the normal of it; the signed distance from its centre line."""
    normal = -np.sin(np.deg2rad(degrees)), np.cos(np.deg2rad(degrees))

    def distance(i, j):
        return (i - MIDDLE_I) * normal[0] + (j - MIDDLE_J) * normal[1] - offset

    return height * np.exp(-0.5 * (distance(ALONG_I, ALONG_J) / sigma) ** 2), normal, distance


def inner(ridges, margin=12):
    i, j = ridges[:, I], ridges[:, J]
    return ridges[(i > margin) & (i < COLUMNS - 1 - margin) & (j > margin) & (j < ROWS - 1 - margin)]


def test_kernel():
    kernel = gaussian(1.0)
    assert len(kernel) == TAPS == 2 * RADIUS + 1
    assert kernel.sum() == pytest.approx(1)
    assert kernel[RADIUS] / kernel[RADIUS - 1] == pytest.approx(np.exp(0.5))
    np.testing.assert_array_equal(kernel, kernel[::-1])


@settings(max_examples=60, deadline=None)
@given(st.floats(0, 180), st.floats(-2, 2), st.sampled_from([1.5, 2.5, 4.0]))
def test_position_and_normal_at_every_angle(degrees, offset, sigma):
    light, normal, distance = stripe(degrees, offset, sigma)
    ridges = inner(ridges_of(coloured(light)))
    assert len(ridges) > 50
    assert np.abs(distance(ridges[:, I], ridges[:, J])).max() < 0.1
    np.testing.assert_allclose(np.hypot(ridges[:, NORMAL_I], ridges[:, NORMAL_J]), 1, atol=1e-9)
    np.testing.assert_allclose(np.abs(ridges[:, NORMAL_I] * normal[0] + ridges[:, NORMAL_J] * normal[1]), 1, atol=1e-3)


@pytest.mark.parametrize("offset", [0.0, 0.2, 0.5, 0.7, 1.0, 1.3, 1.7])
def test_a_stripe_along_the_rows_is_crossed_once_in_two_columns_between_them(offset):
    ridges = ridges_of(coloured(stripe(0, offset)[0]))
    assert np.sort(ridges[:, I]).tolist() == np.arange(0.5, COLUMNS, 2).tolist()
    assert np.abs(ridges[:, J] - MIDDLE_J - offset).max() < 0.05


@pytest.mark.parametrize("offset", [0.0, 0.2, 0.5, 0.7, 1.0, 1.3, 1.7])
def test_a_stripe_along_the_columns_is_crossed_once_in_two_rows_between_them(offset):
    ridges = ridges_of(coloured(stripe(90, offset)[0]))
    assert np.sort(ridges[:, J]).tolist() == np.arange(0.5, ROWS, 2).tolist()
    assert np.abs(ridges[:, I] - MIDDLE_I + offset).max() < 0.05


@pytest.mark.parametrize("degrees", [40, 45, 50, 135])
def test_an_oblique_stripe_has_no_gap(degrees):
    ridges = inner(ridges_of(coloured(stripe(degrees)[0])))
    along = np.sort(ridges[:, I] * np.cos(np.deg2rad(degrees)) + ridges[:, J] * np.sin(np.deg2rad(degrees)))
    assert np.diff(along).max() < 3  # 2 px along rows or columns are 2.83 px along the diagonal


def test_sharpness_is_the_curvature_of_the_smoothed_signal():
    # A stripe of sigma 2.5 px, smoothed with 2 px and over pairs of pixels (variance 1/4): its top is lower by the
    # widths' ratio, and the second derivative there is the height over the variance. The signal is 2 R + G + B.
    variance = 2.5**2 + 2.0**2 + 0.25
    expected = (2 + 0.1 + 0.1) * 180 * 2.5 / np.sqrt(variance) / variance
    ridges = inner(ridges_of(coloured(stripe(0)[0])))
    # a difference over three half-size pixels sees a little less than the derivative
    np.testing.assert_allclose(ridges[:, SHARPNESS], expected, rtol=0.12)
    assert np.all(ridges[:, SHARPNESS] < expected)


def test_a_spot_is_no_ridge():
    spot = 180 * np.exp(-0.5 * ((ALONG_I - 60.3) ** 2 + (ALONG_J - 50.8) ** 2) / 2.5**2)
    ridges = ridges_of(coloured(spot))
    assert not np.any(np.hypot(ridges[:, I] - 60.3, ridges[:, J] - 50.8) < 2)


def test_only_where_it_is_redder_than_its_surroundings():
    light = stripe(0)[0]
    assert len(ridges_of(coloured(light, colour=(0.6, 0.6, 0.6)))) == 0  # bright, not red
    red_here = np.where((ALONG_I >= 40) & (ALONG_I < 60), 1.0, 0.0)
    image = coloured(light, (0.6, 0.6, 0.6)) + coloured(light * red_here, (0.3, 0.0, 0.0), 0.0)
    assert np.sort(ridges_of(image)[:, I]).tolist() == np.arange(40.5, 60, 2).tolist()
    # red all over, and no more so in the stripe: 17 levels are below the threshold, 40 above
    redder = np.full((*SHAPE, 3), [90.0, 30, 30])
    assert len(ridges_of(coloured(light, (17 / 180, 0.0, 0.0), redder))) == 0
    assert len(ridges_of(coloured(light, (40 / 180, 0.0, 0.0), redder))) == COLUMNS / 2


def test_where_red_is_saturated_it_need_not_be_redder():
    light = stripe(0, height=100.0)[0]
    saturated, not_quite = ([255.0, 100, 100], [240.0, 100, 100])
    white = (0.0, 1.0, 1.0)  # all that a saturated red can still tell
    assert len(ridges_of(coloured(light, white, saturated))) == COLUMNS / 2
    assert len(ridges_of(coloured(light, white, not_quite))) == 0


def test_what_is_too_broad_or_faint_is_no_ridge():
    assert len(ridges_of(coloured(stripe(0, sigma=40.0)[0]))) == 0
    assert len(ridges_of(coloured(stripe(0, height=15.0)[0]))) == 0


def test_what_has_no_room_is_counted():
    image = coloured(stripe(0)[0])
    assert ridges_of(image, capacity=COLUMNS // 2 - 1) == COLUMNS / 2
    assert len(ridges_of(image, capacity=COLUMNS // 2)) == COLUMNS / 2

"""Profiles across the stripe, worked out by hand."""

import numpy as np
import pytest

from footscan.stripe.profile import (
    CENTRE_I,
    CENTRE_J,
    CONTRAST,
    SYMMETRY,
    WIDTH,
    measure_profiles,
)


def measure(columns, ridge_i, level=0.25, largest_width=10.0, smallest_redness=5.0, excess=None):
    """The profile of an image whose rows are all `columns`, at a ridge that runs down column `ridge_i`."""
    signal = np.tile(np.array(columns, np.uint16), (30, 1))
    red = signal.astype(np.uint8) if excess is None else np.tile(np.array(excess, np.uint8), (30, 1))
    profiles = np.empty((1, 8))
    ridges = np.array([[ridge_i, 15.0, 1.0, 0.0, 1.0]])
    limits = (largest_width, 10.0, smallest_redness, level)
    return profiles[0] if measure_profiles(signal, red, ridges, limits, profiles) else None


def triangle(centre, half_width=4.0, height=80.0, count=41):
    return np.maximum(0, height * (1 - np.abs(np.arange(count) - centre) / half_width))


def test_triangle():
    # 8 px wide at its foot, so 4 px at half its height
    profile = measure(20 + triangle(20), 20.0)
    assert profile[[CENTRE_I, CENTRE_J]].tolist() == [20, 15]
    assert profile[WIDTH] == pytest.approx(4)
    assert profile[CONTRAST] == pytest.approx(80)
    assert profile[SYMMETRY] == pytest.approx(1)


def test_triangle_sampled_beside_its_top():
    # samples at 19.8 and 20.3: the highest is 80 (1 - 0.2 / 4) = 76, and at half of that it is 4.2 px wide
    profile = measure(20 + triangle(20), 20.3)
    assert profile[CENTRE_I] == pytest.approx(20, abs=0.03)
    assert profile[CONTRAST] == pytest.approx(76)
    assert profile[WIDTH] == pytest.approx(4.2)


def test_centre_of_gravity_of_an_uneven_profile():
    # levels 0 40 80 0: above a quarter of 80, 20 at the left and 60 at the top; linear between the pixels
    profile = measure([0] * 18 + [40, 80] + [0] * 20, 19.0)
    # polygon above 20: from 17.5 (0) over 18 (20), 19 (60) to 19.75 (0); half px samples: 20, 40, 60, 20 at 18 .. 19.5
    assert profile[CENTRE_I] == pytest.approx((20 * 18 + 40 * 18.5 + 60 * 19 + 20 * 19.5) / 140)
    # half height 40 is met at 18 and at 19.5
    assert profile[WIDTH] == pytest.approx(1.5)


def test_an_edge_beside_the_stripe_does_not_draw_its_centre():
    edge = np.where(np.arange(41) < 20, 60, 20)  # grey levels left and right of the middle of the stripe
    profile = measure(np.maximum(edge, 20 + triangle(20, height=160)), 20.0)
    assert profile[CENTRE_I] == pytest.approx(20, abs=0.02)
    assert profile[CONTRAST] == pytest.approx(180 - 60)


@pytest.mark.parametrize(
    "columns",
    [
        np.full(41, 90.0),  # nothing
        np.where(np.arange(41) < 20, 90, 10),  # an edge
        20 + triangle(20, height=8),  # too weak
        20 + 80 * (np.abs(np.arange(41) - 20) < 9),  # too wide
    ],
)
def test_what_does_not_stand_out_from_both_sides_is_dropped(columns):
    assert measure(columns, 20.0) is None


def test_what_is_bright_but_not_red_is_dropped():
    assert measure(20 + triangle(20), 20.0) is not None
    assert measure(20 + triangle(20), 20.0, excess=np.full(41, 30)) is None


def test_a_stripe_cut_off_by_the_border_is_dropped():
    assert measure(20 + triangle(1), 1.0) is None
    assert measure(20 + triangle(5), 5.0) is not None

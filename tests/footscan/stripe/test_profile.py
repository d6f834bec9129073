"""Profiles across the stripe, worked out by hand."""

import numpy as np
import pytest

from footscan.stripe.loop_parameters import METHODS, LoopParameters
from footscan.stripe.profile import COLUMNS, CONTRAST, REDNESS, SATURATION, SYMMETRY, WIDTH, measure_profiles
from footscan.stripe.redness import as_words
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, SHARPNESS, I, J

RED = 2
"""Levels of the signal for one of red."""


def measure(image, *ridge, background=None, **limits):
    """The profile of an image at the ridge (i, j, normal i, normal j), None where there is none."""
    arguments = {
        "red_threshold": 5, "saturation": 250, "faintest": 5.0, "largest_width": 10.0, "centre_level": 0.25,
        "method": METHODS.index("gravity"),
    } | limits  # fmt: skip
    words = as_words(np.asarray(image, np.uint8))
    light = words if background is None else as_words(np.asarray(image - np.minimum(image, background), np.uint8))
    profiles = np.empty((1, COLUMNS))
    found = measure_profiles(words, light, np.array([[*ridge, 7.0]]), LoopParameters(**arguments), profiles)
    return profiles[0] if found else None


def red(levels, rows=30, others=0):
    """An image whose rows are all the same: levels of red, the other colours level."""
    image = np.full((rows, len(levels), 3), others)
    image[..., 0] = levels
    return image


def down(levels, ridge_i, **limits):
    """The profile of a stripe that runs down the columns, at a crossing between rows 14 and 15."""
    return measure(red(levels), ridge_i, 14.5, 1.0, 0.0, **limits)


def triangle(centre, half_width=4.0, height=80.0, count=41):
    return np.maximum(0, np.rint(height * (1 - np.abs(np.arange(count) - centre) / half_width)))


def test_triangle():
    # 8 px wide at its foot, so 4 px at half its height
    profile = down(20 + triangle(20), 20.0)
    assert profile[[I, J, NORMAL_I, NORMAL_J, SHARPNESS]].tolist() == [20, 14.5, 1, 0, 7]
    assert profile[WIDTH] == pytest.approx(4)
    assert profile[CONTRAST] == pytest.approx(RED * 80)
    assert profile[SYMMETRY] == pytest.approx(1)
    assert profile[SATURATION] == 0


def test_the_same_along_the_rows_and_upside_down():
    turned = red(20 + triangle(20)).transpose(1, 0, 2)
    for normal_j in (1.0, -1.0):
        profile = measure(turned, 14.5, 20.0, 0.0, normal_j)
        assert profile[[I, J]].tolist() == [14.5, 20]
        assert profile[WIDTH] == pytest.approx(4)


def test_triangle_whose_top_lies_between_samples():
    # its top at 20.3: 74 at 20 and 66 at 21, so the polygon's height is 74; half of that, 37, is met where the triangle
    # has it, at 20.3 -+ 4 (1 - 37 / 80)
    profile = down(20 + triangle(20.3), 20.2)
    assert profile[CONTRAST] == pytest.approx(RED * 74)
    assert profile[WIDTH] == pytest.approx(8 * (1 - 37 / 80))
    # a quarter, 18.5, at 20.3 -+ 3.075; above it the polygon (17.225, 0), (20, 55.5), (21, 47.5), (23.375, 0)
    areas = np.array([0.5 * 2.775 * 55.5, 0.5 * (55.5 + 47.5), 0.5 * 2.375 * 47.5])
    middles = np.array([17.225 + 2.775 * 2 / 3, 20 + (55.5 + 2 * 47.5) / (3 * 103), 21 + 2.375 / 3])
    assert profile[I] == pytest.approx(areas @ middles / areas.sum())
    assert profile[I] == pytest.approx(20.3, abs=0.02)


def test_the_ridge_need_not_be_at_the_top():
    for ridge_i in (18.6, 19.0, 20.9, 21.4):
        profile = down(20 + triangle(20), ridge_i)
        assert profile[I] == pytest.approx(20)
        assert profile[CONTRAST] == pytest.approx(RED * 80)
        assert profile[WIDTH] == pytest.approx(4)


def test_an_oblique_stripe_is_as_wide_as_it_is_across():
    # a triangle of half width 6 across, its normal turned by 30 degrees from the row
    j, i = np.mgrid[0:60, 0:60]
    normal_i, normal_j = np.cos(np.pi / 6), np.sin(np.pi / 6)
    distance = (i - 30) * normal_i + (j - 30) * normal_j
    image = np.zeros((60, 60, 3))
    image[..., 0] = np.rint(20 + 160 * np.maximum(0, 1 - np.abs(distance) / 6))
    profile = measure(image, 30.0, 30.0, normal_i, normal_j)
    assert profile[WIDTH] == pytest.approx(6, rel=0.02)
    assert (profile[I] - 30) * normal_i + (profile[J] - 30) * normal_j == pytest.approx(0, abs=0.02)
    # the profile runs along the normal
    assert (profile[I] - 30) * normal_j - (profile[J] - 30) * normal_i == pytest.approx(0, abs=1e-9)


def test_symmetry_of_an_uneven_profile():
    # levels 40 80 60 at 19 to 21: half height 40 is met at 19 and 21 + 1/3
    profile = down([0] * 19 + [40, 80, 60] + [0] * 19, 20.0)
    assert profile[WIDTH] == pytest.approx(7 / 3)
    left, right = profile[I] - 19, 64 / 3 - profile[I]
    assert profile[SYMMETRY] == pytest.approx(1 - abs(right - left) / (7 / 3))
    assert profile[SYMMETRY] < 0.999


def test_an_edge_beside_the_stripe_does_not_draw_its_centre():
    edge = np.where(np.arange(41) < 20, 60, 20)  # grey levels left and right of the middle of the stripe
    profile = down(np.maximum(edge, 20 + triangle(20, height=160)), 20.0)
    assert profile[I] == pytest.approx(20, abs=1e-9)
    assert profile[CONTRAST] == pytest.approx(RED * (180 - 60))


def test_a_second_stripe_is_another_profile():
    levels = 20 + np.maximum(triangle(14), triangle(24, height=160.0))
    assert down(levels, 14.0)[I] == pytest.approx(14)
    assert down(levels, 24.0)[I] == pytest.approx(24)


@pytest.mark.parametrize(
    "levels",
    [
        np.full(41, 90.0),  # nothing
        np.where(np.arange(41) < 20, 90, 10),  # an edge
        np.where(np.arange(41) < 20, 90, 10) + (np.arange(41) == 19) * 5,  # with a little ringing
        20 + triangle(20, height=8),  # too weak: 8 levels of red are 4 of brightness
        20 + 80 * (np.abs(np.arange(41) - 20) < 9),  # too wide
    ],
)
def test_what_does_not_stand_out_from_both_sides_is_dropped(levels):
    assert down(levels, 20.0) is None


def test_what_is_bright_but_not_redder_is_dropped():
    grey = np.repeat(red(20 + triangle(20))[..., :1], 3, axis=2)
    ridge = 20.0, 14.5, 1.0, 0.0
    assert measure(grey, *ridge) is None
    assert measure(grey + np.array([30, 0, 0]), *ridge) is None  # red all over
    assert measure(grey + red(0.25 * triangle(20)), *ridge) is not None


def test_redness_is_that_over_the_redder_foot():
    assert down(20 + triangle(20), 20.0)[REDNESS] == 80
    # redder by 15 on one side, up to where the triangle begins
    image = red(20 + triangle(20))
    image[:, :17, 0] += 15
    assert measure(image, 20.0, 14.5, 1.0, 0.0)[REDNESS] == 80 - 15
    # a lamp that is red to a quarter
    lamp = 20 + triangle(20)[np.newaxis, :, np.newaxis] * [1.0, 0.75, 0.75] + np.zeros((30, 1, 1))
    assert measure(lamp, 20.0, 14.5, 1.0, 0.0)[REDNESS] == 20


@pytest.mark.parametrize("greener", [[0, 1, 0], [0, 0, 40], [0, 60, 0]])
def test_what_is_green_or_blue_is_dropped(greener):
    grey = np.repeat(red(20 + triangle(20))[..., :1], 3, axis=2)
    assert measure(grey + greener, 20.0, 14.5, 1.0, 0.0) is None


def test_a_saturated_core_is_told_by_its_flanks():
    # red clipped at 255 over 5 px of 10 above half height; the core is white
    reds = np.minimum(20 + triangle(20, half_width=10.0, height=400), 255)
    image = red(reds)
    image[:, 18:23, 1:] = 200
    profile = measure(image, 20.0, 14.5, 1.0, 0.0, largest_width=30.0)
    assert profile[I] == pytest.approx(20)
    assert 0.3 < profile[SATURATION] <= 1
    white = np.repeat(image[..., :1], 3, axis=2)  # and white flanks on a dark ground are a lamp
    assert measure(white, 20.0, 14.5, 1.0, 0.0, largest_width=30.0) is None


def test_a_saturated_core_with_a_ghost_beside_it_is_told_by_its_halo():
    # red and green (blue as green) from the middle outward: core, whitish flank, halo; then on the left the valley
    # before the ghost, which is as red as the halo, and on the right the skin
    outward = [(255, 255)] * 9 + [(255, 230), (255, 205), (255, 180), (255, 150), (255, 125), (250, 120)]
    valley, skin = [(250, 120)] * 10, [(220, 115), (200, 105)] + [(190, 95)] * 8
    line = np.array([*reversed(outward + valley), *outward[1:], *skin])
    image = np.broadcast_to(line[:, [0, 1, 1]], (30, len(line), 3))
    profile = measure(image, 24.0, 14.5, 1.0, 0.0, largest_width=30.0, red_threshold=18)
    assert profile[I] == pytest.approx(24, abs=0.5)
    lamp = image.copy()
    lamp[..., 1:] = np.maximum(lamp[..., 1:], lamp[..., :1] - 95)  # nothing redder than the skin
    assert measure(lamp, 24.0, 14.5, 1.0, 0.0, largest_width=30.0, red_threshold=18) is None


def test_the_background_is_held_against_redness():
    # a stripe over a red thing: against the frame alone it is as red as what lies beside, and without that it is not
    ground = np.full((30, 41, 3), [100, 20, 20])
    stripe = np.repeat(red(triangle(20))[..., :1], 3, axis=2) * [1.0, 0.9, 0.9]
    image = np.rint(ground + stripe)
    ridge = 20.0, 14.5, 1.0, 0.0
    with_it = measure(image, *ridge, background=ground)
    assert with_it[I] == pytest.approx(20, abs=0.05)
    assert with_it[CONTRAST] == pytest.approx(RED * 80 + 2 * 72)


@pytest.mark.parametrize("turned", [False, True])
def test_a_stripe_cut_off_by_the_border_is_dropped(turned):
    def at(centre, ridge_i):
        levels = 20 + triangle(centre)
        return down(levels[::-1], 40 - ridge_i) if turned else down(levels, ridge_i)

    assert at(5, 5.0) is not None
    assert at(0, 0.0) is None
    assert at(0.2, 0.4) is None
    assert at(-1, 0.0) is None


def test_a_stripe_whose_foot_is_cut_off_by_the_border_is_what_lies_above_its_cut():
    profile = down(20 + triangle(1), 1.0)  # 80 at its top, 60 in column 0: 20 above it, and half of these within 1 px
    assert profile[I] == pytest.approx(1)
    assert profile[CONTRAST] == pytest.approx(RED * 20)
    assert profile[WIDTH] == pytest.approx(1)


@pytest.mark.parametrize("ridge", [(-0.4, 3.0), (40.6, 3.0), (0.0, 0.0), (40.0, 29.0), (20.0, -0.4), (20.0, 29.4)])
@pytest.mark.parametrize("degrees", [0, 30, 45, 90, 135, 180])
def test_ridges_at_the_very_border_read_nothing_outside(ridge, degrees):
    image = np.random.default_rng(2).integers(0, 256, (30, 41, 3))
    normal = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    profile = measure(image, *ridge, *normal)
    assert profile is None or np.isfinite(profile).all()


def test_two_cores_in_saturated_red_are_two_stripes():
    levels = np.where(np.abs(np.arange(41) - 20) <= 4, 255, 20)
    for apart, is_stripe in ((3.6, False), (0.8, True), (0.0, True)):  # speckle makes as deep a valley as the second
        image = red(levels)
        image[..., 1] = image[..., 2] = np.maximum(*(triangle(20 + sign * apart / 2, height=150.0) for sign in (-1, 1)))
        assert (measure(image, 20.0, 14.5, 1.0, 0.0) is not None) is is_stripe

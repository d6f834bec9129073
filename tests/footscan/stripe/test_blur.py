"""Pieces that are rejected by their blur, in crossings written down by hand."""

import numpy as np
import pytest

from footscan.stripe.blur import PEAK, SIGMA, WIDTH, is_laser_light
from footscan.stripe.crossings import BRIGHT, FOOT, MEASURED, RED
from schemas.parameters.extraction import ExtractionParameters

FRAMES = 100
PARAMETERS = ExtractionParameters(red_threshold=18, largest_blur=1.5)
HARDLY_RED = 26.0
"""Less than one and a half times the threshold."""


def crossings(count, width, sigma, red, bright=None, peak=100.0, foot=0.0):
    """`count` of them, all alike; as pure as the stripe of the film unless they say how bright they are."""
    bright = red / 1.5 if bright is None else bright
    alike = np.zeros((count, MEASURED))
    alike[:, [WIDTH, SIGMA, RED, BRIGHT, PEAK, FOOT]] = width, sigma, red, bright, peak, foot
    return alike


def kept(*pieces, frames=FRAMES, **parameters):
    """For each piece, an array of crossings, whether it is; with twenty of a stripe 4 px wide, certain to 0.04 px."""
    stripe = crossings(20, 4.0, 0.04, 60.0)
    sizes = [20, *map(len, pieces)]
    piece = np.repeat(np.arange(len(sizes), dtype=np.int32), sizes)
    changed = PARAMETERS.model_copy(update=parameters)
    parts = np.split(is_laser_light(np.concatenate([stripe, *pieces]), piece, frames, changed), np.cumsum(sizes)[:-1])
    assert all(part.all() or not part.any() for part in parts)  # pieces are judged, not crossings
    assert parts[0].all()
    return [bool(part.all()) for part in parts[1:]]


def test_a_rim_is_wide_and_uncertain_and_hardly_red():
    assert kept(crossings(5, 6.1, 0.061, HARDLY_RED)) == [False]


@pytest.mark.parametrize(
    ("width", "sigma", "red"),
    [
        (6.0, 0.061, HARDLY_RED),  # no more than one and a half times as wide
        (6.1, 0.06, HARDLY_RED),  # or as uncertain
        (6.1, 0.061, 27.0),  # as red as one and a half thresholds
        (30.0, 0.5, 60.0),  # the tip of a toe
    ],
)
def test_what_lacks_one_of_these_is_the_stripe(width, sigma, red):
    assert kept(crossings(5, width, sigma, red)) == [True]


def test_a_piece_goes_by_most_of_its_crossings():
    rim, line = (crossings(count, *like) for count, like in ((3, (9.0, 0.1, 20.0)), (3, (4.0, 0.04, 60.0))))
    assert kept(np.concatenate([rim, line])) == [True]
    assert kept(np.concatenate([rim, line[:2]])) == [False]


@pytest.mark.parametrize(("foot", "is_kept"), [(0.0, False), (255.0 - 18.0, False), (255.0 - 17.0, True)])
def test_a_stripe_on_skin_that_saturates_the_red_is_white(foot, is_kept):
    """A white thing beside which red has room is none of the laser's; where it has none, nobody can tell."""
    assert kept(crossings(8, 4.0, 0.04, 1.0, 15.0, 255.0, foot), saturation=255) == [is_kept]


def test_the_colour_is_judged_where_red_has_room():
    white, red = (crossings(count, 4.0, 0.04, *like) for count, like in ((5, (1.0, 15.0, 255.0, 250.0)), (5, (40.0,))))
    assert kept(np.concatenate([white, red]), saturation=255) == [True]
    dark = crossings(6, 4.0, 0.04, 1.0, 15.0, 255.0, 20.0)
    assert kept(np.concatenate([white, dark]), saturation=255) == [False]


def test_each_piece_is_held_against_the_whole_film():
    # at one place, and one beside it that is as many times as wide as the parameter allows
    rim = crossings(5, 7.9, 0.079, 20.0)
    assert kept(rim, crossings(4, 8.1, 0.081, 20.0), largest_blur=2.0) == [True, False]
    assert kept(rim, rim, largest_blur=1.5) == [False, False]


def test_the_threshold_of_redness_counts():
    rim = crossings(5, 9.0, 0.1, 29.0)
    assert kept(rim) == [True]
    assert kept(rim, red_threshold=20) == [False]


def test_a_white_piece_has_no_red_flanks():
    white, red = crossings(18, 4.0, 0.04, 0.0, peak=250.0), crossings(3, 4.0, 0.04, 18.0, peak=250.0)
    assert kept(white) == [False]
    assert kept(np.concatenate([white, red])) == [True]
    assert kept(np.concatenate([white, red[:2]])) == [False]


def test_a_lit_ridge_is_brighter_in_all_colours():
    # the stripe of the film has a purity of 1.5
    ridge, stripe = crossings(8, 4.0, 0.04, 29.0, bright=40.0), crossings(2, 4.0, 0.04, 31.0, bright=40.0)
    assert kept(ridge) == [False]
    assert kept(np.concatenate([ridge, stripe])) == [True]
    assert kept(np.concatenate([ridge, stripe[:1]])) == [False]


def test_a_saturated_stripe_is_bright_in_all_colours_too():
    assert kept(crossings(8, 4.0, 0.04, 29.0, bright=40.0, peak=221.0)) == [True]
    assert kept(crossings(8, 4.0, 0.04, 29.0, bright=40.0, peak=219.0)) == [False]


def test_a_white_balance_that_takes_the_colour_from_the_stripe():
    stripe = crossings(100, 4.0, 0.04, 30.0, bright=100.0)
    assert kept(stripe, crossings(8, 4.0, 0.04, 20.0, bright=100.0)) == [True, True]


def test_few_frames_tell_nothing():
    rim = crossings(5, 9.0, 0.1, 20.0)
    assert kept(rim, frames=7) == [True]
    assert kept(rim, frames=8) == [False]


def test_a_film_without_a_stripe():
    assert is_laser_light(crossings(0, 0, 0, 0), np.zeros(0, np.int32), FRAMES, PARAMETERS).shape == (0,)

"""Which pieces are the stripe, on points written down as rows of a made-up stripe."""

import numpy as np

from footscan.stripe.pieces import drop_repeated, keep_stripe
from schemas.parameters.extraction import ExtractionParameters

PARAMETERS = ExtractionParameters()


def row(i_from, i_to, j, contrast=400.0, width=4.0, curvature=10.0):
    """One point a column along row `j`, its normal upright."""
    i = np.arange(i_from, i_to, dtype=float)
    ones = np.ones_like(i)
    columns = [i, j * ones, 0 * ones, ones, curvature * ones, width * ones, contrast * ones, ones]
    return np.stack(columns, axis=1)


def kept(*pieces, **parameters):
    keep = keep_stripe(np.concatenate(pieces), PARAMETERS.model_copy(update=parameters))
    return [bool(part.all()) if part.all() or not part.any() else None for part in _split(keep, pieces)]


def _split(keep, pieces):
    return np.split(keep, np.cumsum([len(piece) for piece in pieces])[:-1])


def test_nothing():
    empty = np.empty((0, 8))
    assert len(drop_repeated(empty, PARAMETERS)) == 0
    assert len(keep_stripe(empty, PARAMETERS)) == 0


def test_short_pieces_go():
    assert kept(row(0, 100, 50), row(110, 121, 50)) == [True, False]  # 11 points
    assert kept(row(0, 100, 50), row(110, 122, 50)) == [True, True]
    assert kept(row(0, 100, 50), row(110, 122, 50, width=7)) == [True, False]  # not twice as long as wide


def test_a_small_gap_does_not_part_a_piece():
    assert kept(row(0, 8, 50), row(10, 18, 50)) == [True, True]
    assert kept(row(0, 8, 50), row(14, 22, 50)) == [False, False]


def test_far_and_weak_goes_near_and_weak_stays():
    far, near = row(400, 414, 300), row(130, 144, 50)
    assert kept(row(0, 100, 50), far, near) == [True, False, True]
    assert kept(row(0, 50, 50), row(400, 440, 300)) == [True, True]


def test_ghosts_go():
    stripe = row(0, 100, 50, width=8)
    assert kept(stripe, row(0, 100, 80, contrast=80, width=8)) == [True, False]  # a fifth as bright, 30 px beside
    assert kept(stripe, row(0, 100, 80, contrast=160, width=8)) == [True, True]  # two fifths
    assert kept(stripe, row(0, 100, 80, contrast=160, width=4)) == [True, False]  # two fifths, and half as wide
    far, overhanging = row(0, 100, 120, contrast=80), row(80, 130, 80, contrast=80)
    assert kept(stripe, far, smallest_group=0.0) == [True, True]  # 70 px beside
    assert kept(stripe, overhanging) == [True, True]  # less than half of it lies beside the stripe


def test_the_stripe_is_crossed_once():
    stripe, beside = row(0, 20, 50), row(0, 20, 51.5, curvature=5.0)
    remaining = drop_repeated(np.concatenate([beside, stripe]), PARAMETERS)
    np.testing.assert_array_equal(remaining, stripe)
    twice = drop_repeated(np.concatenate([stripe, stripe]), PARAMETERS)
    np.testing.assert_array_equal(twice, stripe)
    apart = np.concatenate([stripe, row(0, 20, 52.5, curvature=5.0)])  # more than half the width of 4 px
    np.testing.assert_array_equal(drop_repeated(apart, PARAMETERS), apart)


def test_spurs_on_the_shoulder_go():
    stripe = row(0, 20, 50, width=8)
    spur = row(10, 11, 53.5, curvature=2.0)
    spur[0, [2, 3]] = [1, 0]  # its normal lies along the stripe
    np.testing.assert_array_equal(drop_repeated(np.concatenate([stripe, spur]), PARAMETERS), stripe)

"""Selection of the pieces that are the stripe, on points of made-up stripes."""

import numpy as np

from footscan.stripe.chain import pieces_of, place
from footscan.stripe.pieces import keep_stripe
from footscan.stripe.profile import COLUMNS, CONTRAST, LIGHT, SYMMETRY, WIDTH
from footscan.stripe.ridge import NORMAL_J, SHARPNESS, I, J


def row(i_from, i_to, j, contrast=400.0, width=4.0, light=1.0):
    """A crossing in two columns along row `j` (or one for each), its normal upright."""
    i = np.arange(i_from, i_to, 2.0)
    profiles = np.zeros((len(i), COLUMNS))
    profiles[:, I], profiles[:, J], profiles[:, NORMAL_J] = i, j, 1
    profiles[:, SHARPNESS], profiles[:, WIDTH], profiles[:, CONTRAST], profiles[:, SYMMETRY] = 10, width, contrast, 1
    profiles[:, LIGHT] = light
    return profiles


def turned(profiles):
    """The same along a column."""
    return profiles[:, [1, 0, 3, 2, *range(4, COLUMNS)]]


def kept(*pieces, gap=5.0, **limits):
    """For each of the pieces whether it is kept; None where a part of it is."""
    arguments = {
        "smallest_contrast": 32.0, "shortest": 12.0, "ghost_reach": 60.0, "ghost_strength": 0.05, "group_gap": 40.0,
        "smallest_group": 0.15,
    } | limits  # fmt: skip
    results = []
    for way in (lambda profiles: profiles, turned):
        profiles = way(np.concatenate(pieces))
        piece, count = pieces_of(profiles, gap, place(profiles, 480, 640))
        keep = keep_stripe(profiles, piece, count, *arguments.values())
        parts = np.split(keep, np.cumsum([len(part) for part in pieces])[:-1])
        results.append([bool(part.all()) if part.all() or not part.any() else None for part in parts])
    assert results[0] == results[1]
    return results[0]


def test_nothing():
    empty = np.empty((0, COLUMNS))
    assert len(keep_stripe(empty, np.empty(0, np.int32), 0, 32.0, 12.0, 60.0, 0.05, 40.0, 0.15)) == 0


def test_short_pieces_go():
    assert kept(row(0, 100, 50), row(110, 120, 50)) == [True, False]  # 5 crossings, 10 px
    assert kept(row(0, 100, 50), row(110, 122, 50)) == [True, True]
    assert kept(row(0, 100, 50), row(110, 122, 50, width=7.0)) == [True, False]  # not twice as long as wide


def test_a_small_gap_does_not_part_a_piece():
    assert kept(row(0, 8, 50), row(10, 18, 50)) == [True, True]
    assert kept(row(0, 8, 50), row(14, 22, 50)) == [False, False]
    assert kept(row(0, 8, 50), row(14, 22, 50), gap=9.0) == [True, True]


def test_a_piece_must_be_strong_somewhere():
    faint = 24.0  # below the contrast of 32 asked for
    assert kept(row(0, 100, 50, contrast=faint)) == [False]
    assert kept(row(0, 90, 50, contrast=faint), row(90, 96, 50)) == [True, True]  # 6 px of it, half the shortest piece
    assert kept(row(0, 90, 50, contrast=faint), row(90, 94, 50)) == [False, False]


def test_far_and_weak_goes_near_and_weak_stays():
    far, near = row(400, 414, 300), row(130, 144, 50)
    assert kept(row(0, 100, 50), far, near) == [True, False, True]
    assert kept(row(0, 50, 50), row(400, 440, 300)) == [True, True]


def test_a_group_counts_with_all_its_pieces():
    # 14 px are less than 15 % of the stripe's 100, 14 and 12 px thirty away from each other are not
    assert kept(row(0, 100, 50), row(300, 314, 300)) == [True, False]
    assert kept(row(0, 100, 50), row(300, 314, 300), row(340, 352, 300)) == [True, True, True]
    # and hand over hand, a chain of short pieces reaches far
    steps = [row(130 + 45 * n, 144 + 45 * n, 50) for n in range(8)]
    assert kept(row(0, 100, 50), *steps) == [True] * 9


def test_parallel_ghosts_go():
    stripe = row(0, 100, 50)
    assert kept(stripe, row(0, 100, 80, light=0.45)) == [True, False]  # 30 px beside, less than half its light
    assert kept(stripe, row(0, 100, 80, light=0.55)) == [True, True]
    wavy = 80 + 1.5 * np.sin(np.arange(50.0))
    assert kept(stripe, row(0, 100, wavy, light=0.45)) == [True, False]


def test_what_is_weaker_but_not_parallel_stays_unless_it_is_far_weaker():
    stripe, oblique = row(0, 100, 50), 70 + 0.3 * np.arange(0, 100.0, 2)
    assert kept(stripe, row(0, 100, oblique, light=0.45)) == [True, True]  # 20 to 50 px beside
    assert kept(stripe, row(0, 100, oblique, light=0.06)) == [True, True]
    assert kept(stripe, row(0, 100, oblique, light=0.04)) == [True, False]


def test_a_ghost_lies_within_reach_and_most_of_it_beside_the_stripe():
    stripe = row(0, 100, 50)
    for light in (0.45, 0.04):
        far, overhanging = row(0, 100, 120, light=light), row(80, 130, 80, light=light)
        assert kept(stripe, far, smallest_group=0.0) == [True, True]  # 70 px beside
        assert kept(stripe, far, smallest_group=0.0, ghost_reach=75.0) == [True, False]
        assert kept(stripe, overhanging) == [True, True]  # less than half of it lies beside the stripe


def test_a_ghost_of_a_ghost_goes_with_it():
    assert kept(row(0, 100, 50), row(0, 100, 70, light=0.3), row(0, 100, 90, light=0.1)) == [True, False, False]


def test_a_weak_stripe_alone_is_no_ghost():
    assert kept(row(0, 100, 80, light=0.04)) == [True]
    strong, after = row(0, 100, 50), row(110, 200, 50, light=0.04)  # on dark skin, along the same line
    assert kept(strong, after) == [True, True]


def test_what_is_too_short_has_no_ghost():
    assert kept(row(0, 100, 50, light=0.04), row(0, 10, 80)) == [True, False]

"""Links between points, on points of made-up stripes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from footscan.stripe.chain import NONE, in_order, is_sharpest, neighbours, pieces_of, place
from footscan.stripe.profile import COLUMNS, CONTRAST, SYMMETRY, WIDTH
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, SHARPNESS, I, J

ROWS, COLUMNS_OF_FRAME = 480, 640
GAP = 5.0


def points(i, j, normal, width=4.0, sharpness=10.0):
    """Points at (i, j), their normals along `normal`, (i, j) or one for each."""
    i, j = np.broadcast_arrays(np.asarray(i, float), np.asarray(j, float))
    profiles = np.zeros((i.size, COLUMNS))
    profiles[:, I], profiles[:, J] = i, j
    profiles[:, [NORMAL_I, NORMAL_J]] = normal
    profiles[:, WIDTH], profiles[:, SHARPNESS] = width, sharpness
    profiles[:, CONTRAST], profiles[:, SYMMETRY] = 400, 1
    return profiles


def row(start, stop, j, **given):
    """A crossing in two columns along row `j`, its normal upright."""
    return points(np.arange(start, stop, 2.0), j, (0, 1), **given)


def circle(radius, step=2.0, centre=(300, 200)):
    angles = np.arange(0, 2 * np.pi - 0.5 * step / radius, step / radius)
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return points(centre[0] + radius * np.cos(angles), centre[1] + radius * np.sin(angles), normals)


def cells(profiles):
    return place(profiles, ROWS, COLUMNS_OF_FRAME)


def sharpest(profiles):
    return profiles[is_sharpest(profiles, cells(profiles))]


def ordered(profiles):
    """The points in order, the number of the chain of each, checked to be each point exactly once."""
    nearest = neighbours(profiles, GAP, cells(profiles))
    order, chain = in_order(profiles, nearest)
    assert sorted(order) == list(range(len(profiles)))
    return order, chain


def chains(profiles):
    order, chain = ordered(profiles)
    return [order[chain == number] for number in np.unique(chain)]


def test_every_point_is_found_by_its_cell():
    profiles = points(np.random.default_rng(1).uniform(-0.5, 639.5, 500), np.linspace(-0.5, 479.5, 500), (0, 1))
    heads, others = cells(profiles)
    seen = []
    for head in heads.ravel():
        a = head
        while a != NONE:
            seen.append(int(a))
            a = others[a]
    assert sorted(seen) == list(range(500))


def test_the_stripe_is_crossed_once():
    stripe, beside = row(0, 40, 50), row(0, 40, 51.5, sharpness=5.0)
    np.testing.assert_array_equal(sharpest(np.concatenate([beside, stripe])), stripe)
    np.testing.assert_array_equal(sharpest(np.concatenate([stripe, stripe])), stripe)
    apart = np.concatenate([stripe, row(0, 40, 52.5, sharpness=5.0)])  # more than half the width of 4 px
    np.testing.assert_array_equal(sharpest(apart), apart)


def test_spurs_on_the_shoulder_go():
    stripe = row(0, 40, 50, width=8.0)

    def spur_stays(j, contrast):
        spur = points(19, j, (1, 0), width=8.0, sharpness=5.0)  # its normal lies along the stripe
        spur[:, CONTRAST] = contrast
        return len(sharpest(np.concatenate([stripe, spur]))) > len(stripe)

    assert not spur_stays(53.5, 180.0)
    assert spur_stays(53.5, 220.0)  # more than half of the stripe's 400
    assert spur_stays(58.5, 180.0)  # more than a width away


def test_a_dropped_point_drops_none():
    # 51.5 is in the section of 50, and 53 in that of 51.5 alone
    profiles = np.concatenate([points(8, 50 + 1.5 * n, (0, 1), sharpness=10.0 - n) for n in range(3)])
    np.testing.assert_array_equal(sharpest(profiles), profiles[[0, 2]])


def test_neighbours_along_a_row():
    profiles = row(0, 10, 50)
    assert np.sort(neighbours(profiles, GAP, cells(profiles))).tolist() == [[-1, 1], [0, 2], [1, 3], [2, 4], [-1, 3]]


def test_no_neighbours_across_a_gap_beside_or_round_a_sharp_turn():
    for far in (points(5.1, 50, (0, 1)), points(1, 52, (0, 1)), points(3, 50, (1, 0))):
        profiles = np.concatenate([points(0, 50, (0, 1)), far])
        assert neighbours(profiles, GAP, cells(profiles)).tolist() == [[NONE, NONE]] * 2


def test_what_lies_straight_on_is_nearer_than_what_lies_aside():
    profiles = np.concatenate([points(0, 50, (0, 1)), points(2.2, 50, (0, 1)), points(1.5, 51.5, (0, 1))])
    assert 1 in neighbours(profiles, GAP, cells(profiles))[0]
    assert 2 not in neighbours(profiles, GAP, cells(profiles))[0]


@pytest.mark.parametrize("seed", range(5))
def test_an_open_chain_runs_from_end_to_end(seed):
    generator = np.random.default_rng(seed)
    shuffled = generator.permutation(50)
    profiles = row(100, 200, 50)[shuffled]
    profiles[:, [NORMAL_I, NORMAL_J]] *= generator.choice([-1, 1], (50, 1))  # normals have no sense
    (chain,) = chains(profiles)
    along = profiles[chain, I]
    assert along.tolist() in (np.arange(100.0, 200, 2).tolist(), np.arange(198.0, 98, -2).tolist())


@pytest.mark.parametrize("radius", [10.0, 40.0, 150.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_closed_chain_is_cut_open_once(radius, seed):
    generator = np.random.default_rng(seed)
    profiles = circle(radius)
    profiles = profiles[generator.permutation(len(profiles))]
    profiles[:, [NORMAL_I, NORMAL_J]] *= generator.choice([-1, 1], (len(profiles), 1))
    (chain,) = chains(profiles)
    steps = np.hypot(*np.diff(profiles[chain][:, [I, J]], axis=0).T)
    assert steps.max() < 3.1  # 2 px, and the remainder of the way round
    assert np.hypot(*(profiles[chain[0], [I, J]] - profiles[chain[-1], [I, J]])) < 3.1


def test_two_stripes_are_two_chains():
    profiles = np.concatenate([row(0, 100, 50), row(0, 100, 60)])
    assert sorted(sorted(chain) for chain in chains(profiles)) == [list(range(50)), list(range(50, 100))]


def test_a_gap_parts_a_chain():
    assert len(chains(np.concatenate([row(0, 40, 50), row(44, 80, 50)]))) == 2  # 6 px from 38 to 44
    assert len(chains(np.concatenate([row(0, 40, 50), row(42, 80, 50)]))) == 1


def test_branches_hold_every_point_once_and_each_step_is_short():
    stem = row(100, 200, 50)
    t = np.arange(1, 40.0) * 2
    branch = points(150 + t * 0.8, 50 + t * 0.6, (-0.6, 0.8))
    profiles = np.concatenate([stem, branch])
    for chain in chains(profiles):
        assert np.all(np.hypot(*np.diff(profiles[chain][:, [I, J]], axis=0).T) <= GAP)
    # what is not at the fork hangs together
    order, number = ordered(profiles)
    number_of = np.empty(len(profiles), int)
    number_of[order] = number
    far = profiles[:, I] < 140, (profiles[:, I] > 165) & (profiles[:, J] == 50), profiles[:, J] > 65
    assert [len(set(number_of[part])) for part in far] == [1, 1, 1]


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 60), st.integers(0, 2**32 - 1), st.sampled_from([8.0, 30.0, 100.0]))
def test_any_points_are_ordered_once(count, seed, side):
    generator = np.random.default_rng(seed)
    angles = generator.uniform(0, 2 * np.pi, count)
    i, j = generator.uniform(0, side, (2, count))
    profiles = points(i, j, np.stack([np.cos(angles), np.sin(angles)], axis=1))
    order, chain = ordered(profiles)
    assert np.all(np.diff(chain) >= 0)
    if count:
        steps = np.hypot(*np.diff(profiles[order][:, [I, J]], axis=0).T)
        assert np.all(steps[chain[1:] == chain[:-1]] <= GAP)
    # pieces, against all distances at once
    piece, pieces = pieces_of(profiles, GAP, cells(profiles))
    near = np.hypot(i[:, None] - i, j[:, None] - j) <= GAP
    reached = np.linalg.matrix_power(near.astype(float), 64) > 0 if count else near
    np.testing.assert_array_equal(piece[:, None] == piece, reached)
    assert pieces == len(set(piece.tolist()))
    # a chain lies within one piece
    for number in np.unique(chain):
        assert len(set(piece[order[chain == number]])) == 1


def test_pieces():
    profiles = np.concatenate([row(0, 8, 50), row(10, 18, 50), row(22, 30, 50)])  # 4 px apart, and 6
    piece, pieces = pieces_of(profiles, GAP, cells(profiles))
    assert pieces == 2
    assert piece.tolist() == [0] * 8 + [1] * 4


def test_no_points():
    none = np.empty((0, COLUMNS))
    assert len(sharpest(none)) == 0
    assert [len(part) for part in in_order(none, neighbours(none, GAP, cells(none)))] == [0, 0]
    piece, pieces = pieces_of(none, GAP, cells(none))
    assert (len(piece), pieces) == (0, 0)


@pytest.mark.parametrize(("width", "pieces"), [(4.0, 2), (15.0, 2), (17.0, 1)])
def test_a_wide_stripe_hangs_together_over_gaps_of_half_its_width(width, pieces):
    profiles = np.concatenate([row(100, 140, 50, width=width), row(146, 180, 50, width=width)])  # 138 to 146: 8 px
    assert pieces_of(profiles, GAP, cells(profiles))[1] == pieces


def test_of_a_wide_stripe_and_a_narrow_one_the_narrow_one_counts():
    profiles = np.concatenate([row(100, 140, 50, width=20), row(146, 180, 50, width=4)])
    assert pieces_of(profiles, GAP, cells(profiles))[1] == 2

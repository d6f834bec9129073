"""Smoothing along made-up stripes whose noise is known."""

import numpy as np
import pytest

from footscan.stripe.profile import COLUMNS, WIDTH
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, SPACING_PX, I, J
from footscan.stripe.smoothing import FLOOR_PX, PRIOR_PX, smooth_along

SHARE = 2 - np.sqrt(3)
"""Of the next draw in each error, which makes the correlation of neighbours 1/4, and a mean's variance 1.5 times as
large as that of errors that are apart."""


def noise(count, sigma, seed=0, share=SHARE):
    drawn = np.random.default_rng(seed).normal(0, sigma, count + 1)
    return (drawn[1:] + share * drawn[:-1]) / np.sqrt(1 + share**2)


def along(i, j, normals, errors=0.0, width=4.0):
    """Points at (i, j) (N,), each off its place by its error along its normal (N, 2)."""
    profiles = np.zeros((len(normals), COLUMNS))
    profiles[:, [NORMAL_I, NORMAL_J]] = normals
    profiles[:, I], profiles[:, J] = i + errors * normals[:, 0], j + errors * normals[:, 1]
    profiles[:, WIDTH] = width
    return profiles


def line(count, errors, width=4.0):
    return along(2.0 * np.arange(count), 200.0, np.tile([0.0, 1.0], (count, 1)), errors, width)


def smoothed(profiles, reach, chain=None):
    """Moves and sigmas by as many steps on either side as the reach says, for the width of the first point."""
    chain = np.zeros(len(profiles), np.int32) if chain is None else chain
    before = profiles.copy()
    widths = (reach + 0.1) * SPACING_PX / (profiles[0, WIDTH] if len(profiles) else 1.0)
    moves, sigmas = smooth_along(profiles, chain, widths)
    np.testing.assert_array_equal(profiles, before)
    assert np.isfinite(moves).all()
    assert np.all(sigmas > 0)
    return moves, sigmas


def rms(values, axis=None):
    return np.sqrt(np.mean(np.square(values), axis=axis))


def of_a_parabola(reach):
    """The noise of a parabola's middle value, fitted to 2 reach + 1 points, relative to that of a point."""
    steps = np.arange(-reach, reach + 1.0)
    design = np.stack([steps**0, steps, steps**2], axis=1)
    return np.sqrt(np.linalg.inv(design.T @ design)[0, 0])


@pytest.mark.parametrize("sigma", [0.05, 0.3])
@pytest.mark.parametrize("reach", [3, 5, 10, 20])
def test_noise_falls_as_that_of_a_parabola(sigma, reach):
    errors = noise(4000, sigma, share=0.0)
    moves, _ = smoothed(line(4000, errors), reach)
    inner = slice(reach, -reach)
    assert rms((errors + moves)[inner]) == pytest.approx(of_a_parabola(reach) * sigma, rel=0.1)


@pytest.mark.parametrize("sigma", [0.05, 0.1, 0.3])
@pytest.mark.parametrize("reach", [0, 3, 5, 10, 20])
def test_the_sigmas_are_those_of_the_true_errors(sigma, reach):
    errors = noise(4000, sigma)
    moves, sigmas = smoothed(line(4000, errors), reach)
    inner = slice(reach, 4000 - reach)
    assert rms(np.sqrt(sigmas**2 - FLOOR_PX**2)[inner]) == pytest.approx(rms((errors + moves)[inner]), rel=0.1)


def test_noise_grows_with_the_root_of_the_width():
    width = np.where(np.arange(4000) < 2000, 2.0, 8.0)
    errors = 0.1 * noise(4000, 1.0) * np.sqrt(width)
    _, sigmas = smoothed(line(4000, errors, width), 0)
    for part in (slice(0, 2000), slice(2000, 4000)):
        assert rms(sigmas[part]) == pytest.approx(rms(errors[part]), rel=0.1)


def test_what_lies_on_a_parabola_is_not_moved():
    t = 2.0 * np.arange(-50, 51)
    j = 200 + 0.002 * t**2
    moves, sigmas = smoothed(along(300 + t, j, np.tile([0.0, 1.0], (101, 1))), 10)
    assert np.abs(moves).max() < 1e-9
    assert np.all(sigmas >= FLOOR_PX)


def test_reach_0_moves_nothing():
    moves, sigmas = smoothed(line(200, noise(200, 0.2)), 0)
    assert not moves.any()
    assert np.ptp(sigmas) == 0


@pytest.mark.parametrize(("width", "steps"), [(4.0, 6), (8.0, 12)])
def test_the_reach_is_so_many_widths(width, steps):
    # 3 widths of 4 px and of 8 px are 6 and 12 steps of 2 px
    profiles = line(400, noise(400, 0.3), width)
    still = np.zeros(400, np.int32)
    own, smooth = (smooth_along(profiles, still, widths)[1] for widths in (0.0, 3.0))
    ratio = np.sqrt((smooth**2 - FLOOR_PX**2) / (own**2 - FLOOR_PX**2))
    assert np.median(ratio) == pytest.approx(np.sqrt(1.5) * of_a_parabola(steps), rel=1e-6)


def test_a_few_points_have_the_noise_of_their_kind():
    moves, sigmas = smoothed(line(3, noise(3, 5.0)), 10)
    assert not moves.any()  # nothing is a parabola through less than five
    np.testing.assert_allclose(sigmas, np.hypot(PRIOR_PX * 2, FLOOR_PX))  # for a width of 4 px
    assert [len(part) for part in smoothed(line(0, noise(0, 1.0)), 10)] == [0, 0]


def test_chains_do_not_draw_each_other():
    errors = noise(200, 0.1)
    offset = np.where(np.arange(200) < 100, 0.0, 0.5)
    chain = np.repeat(np.array([0, 1], np.int32), 100)
    moves, _ = smoothed(line(200, errors + offset), 10, chain)
    for part in (slice(0, 100), slice(100, 200)):
        alone, _ = smoothed(line(200, errors), 10, chain)
        np.testing.assert_allclose(moves[part], alone[part], atol=1e-9)


def test_the_sense_of_the_normal_turns_the_move():
    errors = noise(200, 0.1)
    senses = np.random.default_rng(3).choice([-1.0, 1.0], 200)
    profiles = line(200, errors)
    moves, sigmas = smoothed(profiles, 10)
    profiles[:, [NORMAL_I, NORMAL_J]] *= senses[:, None]
    turned, same = smoothed(profiles, 10)
    np.testing.assert_allclose(turned, senses * moves, atol=1e-12)
    np.testing.assert_allclose(same, sigmas, atol=1e-12)


def corner(errors):
    """Along row 200 to column 300, then down it: steps of 2 px, the corner itself in the middle."""
    t = 2.0 * np.arange(-60, 61)
    normals = np.where((t < 0)[:, None], [0.0, 1.0], [1.0, 0.0])
    normals[60] = np.sqrt(0.5), -np.sqrt(0.5)
    return t, along(np.where(t < 0, 300 + t, 300), np.where(t < 0, 200, 200 + t), normals, errors)


def step(errors):
    """Along row 200, from column 300 along row 202."""
    t = 2.0 * np.arange(-60, 60) + 1
    return t, along(300 + t, np.where(t < 0, 200, 202), np.tile([0.0, 1.0], (120, 1)), errors)


@pytest.mark.parametrize("shape", [corner, step])
def test_corners_and_steps_are_not_rounded(shape):
    count = 121 if shape is corner else 120
    t, profiles = shape(np.zeros(count))
    moves, _ = smoothed(profiles, 10)
    assert not moves[np.abs(t) >= 4].any()
    assert np.abs(moves).max() < 0.55  # of a step of 2 px, and of a corner that a parabola would cut by more


@pytest.mark.parametrize("shape", [corner, step])
@pytest.mark.parametrize("sigma", [0.03, 0.05, 0.1])
def test_beside_corners_and_steps_errors_stay_near_the_noise(shape, sigma):
    """The window of a point ends before the corner only once the noise lets it see that: a part of it is let in."""
    count = 121 if shape is corner else 120
    errors = [noise(count, sigma, seed) for seed in range(100)]
    t = shape(errors[0])[0]
    after = np.array([error + smoothed(shape(error)[1], 10)[0] for error in errors])
    beside, far = (np.abs(t) >= 4) & (np.abs(t) < 24), (np.abs(t) >= 24) & (np.abs(t) < 100)
    assert rms(after[:, beside], axis=0).max() < 1.5 * sigma + 0.05
    assert rms(after[:, beside]) < 1.1 * sigma + 0.01
    assert np.abs(after[:, beside]).max() < 0.4
    # farther than the reach of 10 steps they are as beside no corner; neighbours' noise keeps 1.5 times the variance
    assert rms(after[:, far]) == pytest.approx(np.sqrt(1.5) * of_a_parabola(10) * sigma, rel=0.15)


@pytest.mark.parametrize("sigma", [0.0, 0.05])
@pytest.mark.parametrize("radius", [40.0, 80.0, 180.0])
def test_a_circle_neither_shrinks_nor_grows(radius, sigma):
    angles = np.arange(0, 2 * np.pi, 2.3 / radius)
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    errors = noise(len(angles), sigma) if sigma else np.zeros(len(angles))
    profiles = along(300 + radius * normals[:, 0], 200 + radius * normals[:, 1], normals, errors)
    moves, _ = smoothed(profiles, 10)
    assert abs(np.mean(errors + moves) - np.mean(errors)) < 0.02

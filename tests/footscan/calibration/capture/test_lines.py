"""Straight pieces of the stripe and their corners, on stripes drawn by hand."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from footscan.calibration.capture.lines import ImageCorner, find_corners, find_lines

Floats = NDArray[np.float64]

SEED = 20261120
STAIRS = np.array([[60.0, 300.0], [150.0, 180.0], [310.0, 240.0], [370.0, 150.0], [560.0, 215.0]])
"""Corners of a stripe as over a stepped object: pieces of 150, 171, 108 and 201 px."""


def stripe(corners: Floats, bend: float = 0.0) -> Floats:
    """A point about every px along the polyline, in the order of the rows; `bend` moves a piece to its left by
    bend (s^2 - half^2), so that it still meets its corners."""
    pieces = []
    for a, b in pairwise(corners):
        length = float(np.hypot(*(b - a)))
        along = (b - a) / length
        s = np.arange(0.5, length) - length / 2
        left = np.array([along[1], -along[0]])
        pieces.append((a + b) / 2 + s[:, None] * along + bend * (s**2 - length**2 / 4)[:, None] * left)
    points = np.concatenate(pieces)
    return points[np.lexsort((points[:, 0], np.rint(points[:, 1])))]


def nearest(corners: list[ImageCorner], position: Floats) -> float:
    return min(float(np.hypot(*(corner.position - position))) for corner in corners)


def test_a_line_by_hand() -> None:
    i = np.arange(100.0, 151.0)
    (line,) = find_lines(np.column_stack([i, 20.0 + 0.75 * i]))
    # 3 i - 4 j = -80, divided by 5.
    sign = np.sign(line.normal[0])
    np.testing.assert_allclose(sign * line.normal, [0.6, -0.8], atol=1e-12)
    assert sign * line.offset == pytest.approx(-16.0, abs=1e-9)
    np.testing.assert_allclose(np.sort(line.ends, axis=0), [[100.0, 95.0], [150.0, 132.5]], atol=1e-9)
    assert line.length == pytest.approx(62.5)
    assert line.rms_px < 1e-9
    np.testing.assert_allclose(line.bend, 0.0, atol=1e-9)
    np.testing.assert_array_equal(np.sort(line.points), np.arange(51))
    assert abs(line.distances(np.array([[0.0, 25.0]]))[0]) == pytest.approx(4.0)  # 3*0 - 4*25 + 80 = -20


def test_a_bent_piece_keeps_its_bend() -> None:
    i = np.arange(100.0, 351.0)
    (line,) = find_lines(np.column_stack([i, 200.0 + 1.28e-4 * (i - 225.0) ** 2]))  # sagitta 2 px over 250 px
    assert len(line.points) == 251
    assert abs(line.bend[2]) == pytest.approx(1.28e-4, rel=0.01)
    assert line.rms_px < 0.01
    np.testing.assert_allclose(line.ends[np.argsort(line.ends[:, 0])], [[100.0, 202.0], [350.0, 202.0]], atol=0.02)


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("bend", [0.0, 6e-5, -6e-5])
def test_pieces_and_corners_of_stairs(noise: float, bend: float) -> None:
    exact = stripe(STAIRS, bend)
    points = exact + np.random.default_rng(SEED).normal(0.0, noise, exact.shape)
    lines = find_lines(points)
    np.testing.assert_allclose([line.length for line in lines], [200.9, 170.9, 150.0, 108.2], atol=4.0)
    belonging = np.concatenate([line.points for line in lines])
    assert len(np.unique(belonging)) == len(belonging) > 0.97 * len(points)
    corners = find_corners(lines, points)
    assert len(corners) == 3
    for position in STAIRS[1:-1]:
        assert nearest(corners, position) < 0.02 + 1.5 * noise
    for corner in corners:
        assert corner.lines[0] != corner.lines[1]
        # At the end of n points a straight line has the variance 4 / n, a parabola that must be extrapolated by 5 px
        # from a half length of 49 px 13.3 / n; one point in four counts; the pieces have 99 to 192 points, and meet
        # under 74 degrees or more; no noise is taken to be less than 0.1 px.
        assert np.sqrt(4 * 4.0 / 192) < corner.sigma_px / max(noise, 0.1) < 1.1 * np.sqrt(4 * 13.3 / 99) / np.sin(1.29)


def test_sigma_tells_the_error() -> None:
    """Over many draws of independent noise of 0.2 px the error is not above what sigma says, which allows for
    neighbours that err together."""
    random = np.random.default_rng(SEED)
    exact = stripe(STAIRS)
    ratios = []
    for _ in range(40):
        points = exact + random.normal(0.0, 0.2, exact.shape)
        corners = find_corners(find_lines(points), points)
        assert len(corners) == 3
        for corner in corners:
            error = corner.position - STAIRS[np.argmin(np.hypot(*(STAIRS - corner.position).T))]
            ratios.append(np.mean(error**2) / corner.sigma_px**2)
    assert 0.1 < np.mean(ratios) < 1.0


def test_what_is_biased_near_a_corner_is_left_out() -> None:
    """One corner rounded over 8 px, by 0.3 px: without those points its pieces are exact."""
    points = stripe(STAIRS)
    rounded = np.maximum(0.0, 1.0 - np.linalg.norm(points - STAIRS[2], axis=1) / 8.0)
    points -= 0.3 * rounded[:, None] * np.array([0.0, 1.0])

    def error(leave_out_px: float) -> float:
        corners = find_corners(find_lines(points), points, leave_out_px)
        assert len(corners) == 3
        return nearest(corners, STAIRS[2])

    assert error(9.0) < 1e-6
    assert 1e-3 < error(5.0) < 0.1


@pytest.mark.parametrize(("gap", "pieces"), [(30.0, 1), (60.0, 2)])
def test_a_gap_in_a_piece(gap: float, pieces: int) -> None:
    points = stripe(np.array([[100.0, 200.0], [380.0, 220.0]]))
    points = points[np.abs(points[:, 0] - 240.0) > gap / 2]
    lines = find_lines(points)
    assert len(lines) == pieces
    assert sum(len(line.points) for line in lines) == len(points)
    assert find_corners(lines, points) == []


def test_pieces_that_do_not_reach_each_other_have_no_corner() -> None:
    for distance, count in ((10.0, 1), (20.0, 0)):
        corner = np.array([200.0, 200.0])
        first = stripe(np.array([[60.0, 200.0], corner - [distance, 0.0]]))
        second = stripe(np.array([[200.0, 200.0 + distance], [200.0, 320.0]]))
        points = np.concatenate([first, second])
        assert len(find_corners(find_lines(points), points)) == count


def test_pieces_are_found_among_clutter() -> None:
    """A third of the points false: a ghost beside the stripe, blots, strewn points."""
    random = np.random.default_rng(SEED)
    true = stripe(STAIRS, 4e-5)
    true = true + random.normal(0.0, 0.15, true.shape)
    ghost = stripe(STAIRS[1:3] + np.array([4.0, -14.0]))[20:110:2]
    blots = np.concatenate([random.normal(centre, 2.0, (25, 2)) for centre in ([120, 80], [420, 330], [500, 90])])
    strewn = random.uniform([0, 0], [639, 479], (150, 2))
    points = np.concatenate([true, ghost, blots, strewn])
    lines = find_lines(points)
    own = [line for line in lines if np.mean(line.points < len(true)) > 0.9]
    np.testing.assert_allclose([line.length for line in own], [200.9, 170.9, 150.0, 108.2], atol=5.0)
    corners = find_corners(lines, points)
    for position in STAIRS[1:-1]:
        assert nearest(corners, position) < 0.3


def test_short_pieces_and_too_few_points_are_none() -> None:
    assert find_lines(np.empty((0, 2))) == []
    assert find_lines(np.array([[1.0, 2.0], [3.0, 4.0]])) == []
    assert find_lines(np.full((50, 2), 7.0)) == []
    assert find_lines(stripe(np.array([[100.0, 100.0], [111.0, 100.0]]))) == []
    assert len(find_lines(stripe(np.array([[100.0, 100.0], [120.0, 100.0]])))) == 1
    assert find_corners([], np.empty((0, 2))) == []


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_order_of_the_points_does_not_matter(seed: int) -> None:
    points = stripe(STAIRS) + np.random.default_rng(SEED).normal(0.0, 0.2, (len(stripe(STAIRS)), 2))
    order = np.random.default_rng(seed).permutation(len(points))
    lines, shuffled = find_lines(points), find_lines(points[order])
    assert len(lines) == len(shuffled)
    for a, b in zip(lines, shuffled, strict=True):
        np.testing.assert_array_equal(a.points, order[b.points])
        np.testing.assert_array_equal(a.ends, b.ends)
    for c, d in zip(find_corners(lines, points), find_corners(shuffled, points[order]), strict=True):
        np.testing.assert_array_equal(c.position, d.position)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 120), st.integers(1, 3))
def test_any_points_are_taken(seed: int, count: int, spread: int) -> None:
    """Whole numbers on a small grid: points that coincide, lie in rows and fill squares."""
    points = np.random.default_rng(seed).integers(0, 15 * spread, (count, 2)).astype(np.float64)
    lines = find_lines(points)
    find_corners(lines, points)
    belonging = np.concatenate([line.points for line in lines]) if lines else np.empty(0)
    assert len(np.unique(belonging)) == len(belonging)

"""The convex region of pixels that data support."""

from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from footscan.calibration.models.region import region_of, supported
from schemas.base.units import Point

PIXELS = st.lists(st.tuples(st.integers(0, 639), st.integers(0, 479)), min_size=3, max_size=40)


def test_hull_of_the_clicks() -> None:
    pixels = np.array([[100, 50], [0, 0], [40, 20], [100, 0], [60, 30], [0, 50.0]])
    assert region_of(pixels) == [(0, 0), (100, 0), (100, 50), (0, 50)]


@pytest.mark.parametrize(
    "pixels",
    [[], [[1, 2]], [[1, 2], [3, 4]], [[0, 0], [1, 2], [2, 4], [10, 20]], [[5, 5]] * 4, [[0, 0], [300, 0.01], [600, 0]]],
)
def test_a_line_has_no_region(pixels: list[list[float]]) -> None:
    assert region_of(np.array(pixels, np.float64).reshape(-1, 2)) == []


@given(PIXELS, st.randoms())
def test_the_order_of_points_does_not_matter(pixels: list[Point], random: Random) -> None:
    shuffled = pixels.copy()
    random.shuffle(shuffled)
    assert region_of(np.array(shuffled, np.float64)) == region_of(np.array(pixels, np.float64))


@settings(deadline=None)
@given(PIXELS)
def test_every_point_lies_in_its_own_region(pixels: list[Point]) -> None:
    points = np.array(pixels, np.float64)
    region = region_of(points)
    if region:
        assert supported(region, points).all()
        middle, corners = points.mean(axis=0), np.array(region)
        assert not supported(region, middle + 1.01 * (corners - middle)).any()


@pytest.mark.parametrize("turned", [False, True])
def test_supported_by_a_triangle(turned: bool) -> None:
    corners: list[Point] = [(0, 0), (4, 0), (0, 4)]
    region = corners[::-1] if turned else corners
    pixels = np.array([[1, 1], [0, 0], [4, 0], [2, 2], [2.1, 2.1], [-0.1, 1], [1, -1], [np.nan, 1]])
    assert supported(region, pixels).tolist() == [True, True, True, True, False, False, False, False]
    # (2.1, 2.1) is 0.1 sqrt(2) = 0.141 px beyond the long side, (1, -1) is 1 px beyond another
    assert supported(region, pixels, 0.15).tolist() == [True, True, True, True, True, True, False, False]


def test_unknown_region_supports_all() -> None:
    assert supported([], np.array([[1e6, -5.0]])).tolist() == [True]


def test_corners_that_stand_twice() -> None:
    region: list[Point] = [(0, 0), (4, 0), (4, 0), (0, 4), (0, 0)]
    assert supported(region, np.array([[1.0, 1.0], [3.0, 3.0]])).tolist() == [True, False]


def test_no_pixels() -> None:
    assert supported([(0, 0), (4, 0), (0, 4)], np.empty((0, 2))).shape == (0,)

import numpy as np
import pytest

from footscan.report.colours import colour_bar, colour_limit, distance_colours


@pytest.mark.parametrize(
    ("distance", "limit"),
    [
        ([0.0, 0.1, -0.2], 0.5),
        ([-0.9] * 100, 1.0),
        ([1.2] * 99 + [np.nan], 1.5),
        ([0.3] * 99 + [40.0], 0.5),
        ([np.nan], 0.5),
    ],
)
def test_the_limit_is_a_half_mm_above_nearly_all_distances(distance, limit):
    assert colour_limit(np.array(distance)) == limit


def test_inside_is_blue_zero_pale_outside_red_unknown_grey():
    colours = distance_colours(np.array([-2.0, -1.0, 0.0, 1.0, 7.0, np.nan]), 1.0)
    assert colours.dtype == np.uint8
    assert colours.tolist() == [[24, 62, 140], [24, 62, 140], [244, 244, 240], [150, 22, 38], [150, 22, 38], [165] * 3]


def test_between_stops_colours_run_linearly():
    # -1/6 lies half way between the stops at -1/3, (158, 202, 225), and at 0, (244, 244, 240).
    assert distance_colours(np.array([-1 / 6]), 1.0).tolist() == [[201, 223, 232]]


def test_the_bar_names_its_limits():
    bar = colour_bar(1.5)
    assert "−1.50" in bar
    assert "+1.50" in bar
    assert "+0.75" in bar

"""Cameras that film in different passes see the foot at different moments."""

import numpy as np

from footscan.cloud.movement.passes import BETWEEN_PASSES, find_first_moments
from footscan.cloud.movement.steady import steadied
from tests.helpers.moving_foot import FRAMES, scan

STILL = np.zeros((2, FRAMES))
TWO_CAMERAS, FOUR_HEADS = {1: 1, 2: 2, 3: 1, 4: 2}, {1: 1, 2: 2, 3: 3, 4: 4}
"""Cameras 3 and 4 are on the heads of 1 and 2, and film in a second pass."""
SECOND = dict.fromkeys((3, 4), FRAMES - 1 + BETWEEN_PASSES)
SWAYS = [np.tile(0.3 * np.sin(pace * np.arange(FRAMES)), (2, 1)) for pace in (0.17, 0.25)]  # 0.2 mm, root mean square
TREMORS = [np.tile(0.4 * np.sin(pace * np.arange(FRAMES)), (2, 1)) for pace in (2.9, 2.4)]
INNER = np.s_[10 : FRAMES - 10]


def in_two_passes(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    second["camera"] += 2
    return np.concatenate([first, second])


def test_the_sway_of_each_pass_is_found_also_where_planes_coincide() -> None:
    points = in_two_passes(*(scan(STILL, sway) for sway in SWAYS))
    assert steadied(points, TWO_CAMERAS)[1].sway_by_axis_mm is None
    moved, report = steadied(points, FOUR_HEADS, SECOND)
    assert report.sway_by_axis_mm is not None
    assert 0.12 < report.sway_by_axis_mm[1] < 0.4
    assert report.first_moments == SECOND
    np.testing.assert_array_equal(moved["frame"], points["frame"])


def test_the_sway_of_each_pass_is_taken_back() -> None:
    moved, report = steadied(in_two_passes(*(scan(STILL, sway, 4.0) for sway in SWAYS)), FOUR_HEADS, SECOND)
    for first, sway in zip((0, SECOND[3]), SWAYS, strict=True):
        way = np.array(report.y_mm[first : first + FRAMES])[INNER]
        assert np.corrcoef(way, sway[0, INNER])[0, 1] > 0.75
    assert np.ptp(moved["y"][moved["camera"] == 1]) > 50.0  # a foot is still there


def test_the_tremor_of_each_pass_is_taken_back() -> None:
    points = in_two_passes(*(scan(tremor) for tremor in TREMORS))
    tremor = np.where(points["camera"] < 3, *(tremor[0][points["frame"]] for tremor in TREMORS))

    def left(moved: np.ndarray) -> float:
        return float(np.sqrt(np.mean((moved["x"] - points["x"] + tremor) ** 2)))

    assert left(steadied(points, TWO_CAMERAS)[0]) > 0.15  # the mean of two tremors is neither
    moved, report = steadied(points, FOUR_HEADS, SECOND)
    assert left(moved) < 0.1
    assert report.agreement is not None
    assert report.agreement > 0.6


def test_moments_of_cameras_that_show_nothing() -> None:
    points = scan(STILL)
    assert find_first_moments(points[:0], {1: 2}) == {}
    assert find_first_moments(points[points["camera"] == 2], {1: 2, 2: 3}) == {2: 0}

"""A foot that moves slowly is found where heads film the same skin at different times."""

import numpy as np
import pytest

from footscan.cloud.fusion.stripes import sort_stripes
from footscan.cloud.movement.steady import DOUBT_MM, steadied
from footscan.cloud.movement.sway import sway_of
from tests.helpers.moving_foot import FRAMES, HEADS, scan

STILL = np.zeros((2, FRAMES))
SWAYING = np.tile(0.7 * np.sin(0.17 * np.arange(FRAMES)), (2, 1))  # 0.5 Hz at 18 frames a second
AHEAD_MM = 4.0
INNER = np.s_[10 : FRAMES - 10]


def sizes_of(points: np.ndarray) -> tuple[float, float]:
    sway = sway_of(sort_stripes([points]), HEADS)
    assert sway is not None
    return sway.sizes_mm


@pytest.mark.parametrize("axis", [0, 1])
def test_sway_is_found_along_and_across_the_travel(axis: int) -> None:
    moved = [STILL, STILL]
    moved[axis] = SWAYING
    sizes = sizes_of(scan(moved[0], moved[1], AHEAD_MM))
    assert 0.25 < sizes[axis] < 1.0  # true: 0.5
    assert sizes[1 - axis] < 0.2


def test_heads_that_are_apart_as_a_whole_are_no_sway() -> None:
    apart = STILL + np.array([[0.0], [0.3]])
    for points in (scan(STILL, None, AHEAD_MM), scan(STILL, apart, AHEAD_MM), scan(apart, None, AHEAD_MM)):
        assert max(sizes_of(points)) < 0.1


def test_heads_that_are_turned_pass_the_skin_at_other_times() -> None:
    # The second plane is behind the first one at the sole, and ahead of it at the instep.
    sway = sway_of(sort_stripes([scan(STILL, SWAYING, -AHEAD_MM, pitch=-AHEAD_MM / 48.0)]), HEADS)
    assert sway is not None
    assert sway.sizes_mm[0] < 0.2  # it does not look like a movement along the travel
    assert np.corrcoef(sway.y_mm[INNER], SWAYING[0, INNER])[0, 1] > 0.75


def test_a_foot_that_sways_a_little_is_moved_back_across_the_travel() -> None:
    swaying = 0.4 * SWAYING  # 0.2 mm, root mean square
    still, points = scan(STILL, None, AHEAD_MM), scan(STILL, swaying, AHEAD_MM)
    moved, report = steadied(points, HEADS)
    way = np.array(report.y_mm)[:FRAMES]
    slopes = [np.sqrt(np.mean(np.diff(left[INNER]) ** 2)) for left in (swaying[0], swaying[0] - way)]
    assert slopes[1] < 0.7 * slopes[0]
    assert report.sway_by_axis_mm is not None
    assert np.mean(report.left_y_mm[INNER]) < report.sway_by_axis_mm[1]
    drift = (swaying[0] - way)[INNER][16:] - (swaying[0] - way)[INNER][:-16]
    assert 0.4 < np.sqrt(np.mean(drift**2)) / (np.sqrt(2.0) * np.mean(report.left_y_mm[INNER])) < 1.6
    assert report.left_y_frames is not None
    assert 2.0 < report.left_y_frames < 8.0
    assert "swayed by 0." in report.warnings[-1]
    np.testing.assert_allclose(moved["y"], points["y"] - way[points["frame"]], atol=1e-4)
    assert steadied(still, HEADS)[1].y_mm == []


def test_planes_that_coincide_show_no_sway() -> None:
    points = scan(STILL, SWAYING)
    assert sway_of(sort_stripes([points]), HEADS) is None
    assert steadied(points, HEADS)[1].sway_by_axis_mm is None


def test_a_foot_that_moved_slowly_is_reported_and_left_where_it_is() -> None:
    points = scan(STILL, SWAYING, AHEAD_MM)
    moved, report = steadied(points, HEADS)
    np.testing.assert_array_equal(moved, points)
    assert report.sway_mm > DOUBT_MM
    assert report.doubt == report.warnings[-1]
    assert "moved slowly" in report.doubt


def test_one_head_alone_shows_no_sway() -> None:
    points = scan(STILL, SWAYING, AHEAD_MM)
    assert sway_of(sort_stripes([points]), {1: 1, 2: 1}) is None
    assert sway_of(sort_stripes([points[points["camera"] == 1]]), HEADS) is None
    assert sway_of(sort_stripes([points[:0]]), HEADS) is None

"""A foot that trembles is moved back; one that stands still is not, whatever its form."""

import numpy as np
import pytest

from footscan.cloud.movement.steady import steadied
from footscan.cloud.points import make_points
from tests.helpers.moving_foot import FRAMES, HEADS, scan


@pytest.mark.parametrize("per_frame", [2.9, 2.4])
def test_tremor_is_found_and_taken_back(per_frame: float) -> None:
    tremor = 0.4 * np.sin(per_frame * np.arange(FRAMES))
    trembling = scan(np.array([tremor, tremor]))
    moved, report = steadied(trembling, HEADS)
    assert report.tremor_mm == pytest.approx(0.28, abs=0.05)
    assert report.agreement is not None
    assert report.agreement > 0.6
    assert "trembled" in report.warnings[0]
    # Each stripe now lies at the place on the foot that it shows.
    left = moved["x"] - (trembling["x"] - tremor[trembling["frame"]])
    assert np.median(np.abs(left)) < 0.05
    assert np.sqrt(np.mean(left**2)) < 0.14  # half of it
    np.testing.assert_array_equal(moved["y"], trembling["y"])


def test_a_still_foot_is_left_where_it_is() -> None:
    points = scan(np.zeros((2, FRAMES)))
    moved, report = steadied(points, HEADS)
    np.testing.assert_array_equal(moved, points)
    assert not report.warnings
    assert not report.x_mm
    assert report.tremor_mm < 0.1


def test_heads_that_run_unevenly_are_no_tremor() -> None:
    jitter = np.random.default_rng(1).normal(0.0, 0.4, (2, FRAMES))
    points = scan(jitter)
    moved, report = steadied(points, HEADS)
    np.testing.assert_array_equal(moved, points)
    assert report.agreement is not None
    assert report.agreement < 0.5
    assert report.tremor_mm > 0.1  # it counts as an error of the measures
    [warning] = report.warnings
    assert "heads do not agree on it" in warning


def test_points_that_show_nothing_are_left() -> None:
    for points in (np.empty(0, make_points(np.zeros((1, 3)), camera=1).dtype), scan(np.zeros((2, FRAMES)))[:40]):
        moved, report = steadied(points, HEADS)
        np.testing.assert_array_equal(moved, points)
        assert report.tremor_mm == 0.0

import numpy as np
import pytest

from footscan.cloud.points import make_points
from footscan.report.scan.coverage import coverage_plot, points_per_frame, ticks
from schemas.quality import CameraQuality

CLOUD = make_points(np.zeros((6, 3)), camera=np.array([1, 1, 1, 2, 1, 2]), frame=np.array([0, 2, 2, 1, 9, -1]))


def camera(number):
    return CameraQuality(camera=number, frames=4, frames_lost=1, frames_with_stripe=2, points=3, removed={})


def test_points_are_counted_by_camera_and_frame():
    assert points_per_frame(CLOUD, 1, 4).tolist() == [1, 0, 2, 0]
    assert points_per_frame(CLOUD, 2, 4).tolist() == [0, 1, 0, 0]
    assert points_per_frame(CLOUD, 3, 4).tolist() == [0, 0, 0, 0]


def test_each_camera_has_a_line_to_the_common_scale():
    plot = coverage_plot(CLOUD, [camera(1), camera(2)])
    # Heights run down from the greatest count, 2.
    assert '<path class="line" d="M0 1L1 2L2 0L3 2"/>' in plot
    assert '<path class="line" d="M0 2L1 1L2 2L3 2"/>' in plot


def test_a_scan_without_frames_has_no_plot():
    assert "svg" not in coverage_plot(CLOUD, [])


@pytest.mark.parametrize(
    ("frames", "expected"),
    [(1, [0]), (3, [0, 1, 2]), (9, [0, 2, 4, 6, 8]), (200, [0, 50, 100, 150]), (201, [0, 50, 100, 150, 200])],
)
def test_ticks_are_round_and_few(frames, expected):
    assert list(ticks(frames)) == expected

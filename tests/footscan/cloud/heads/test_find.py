"""Where the heads are, from the skin that cameras of two heads see."""

from dataclasses import replace

import numpy as np
import pytest

from footscan.cloud.heads.find import find_heads
from footscan.cloud.heads.planes import corrected, places_of
from schemas.calibration import LaserPlane
from schemas.heads import HeadsReport
from schemas.parameters.heads import HeadParameters
from tests.footscan.cloud.heads.ellipsoid import HEADS, points_of, views

SMALL = (0.0, 0.0, -0.3)


@pytest.fixture(scope="module")
def small() -> HeadsReport:
    return find_heads(points_of(SMALL), views(), HeadParameters())


def test_heads_at_their_places_are_left_there() -> None:
    report = find_heads(points_of((0.0, 0.0, 0.0)), views(), HeadParameters())
    assert report.comparisons > 1000
    assert not report.is_corrected
    assert report.largest_mm == 0.0
    assert report.warnings == []
    assert report.doubt is None


def test_a_small_offset_is_found_and_reported(small: HeadsReport) -> None:
    offsets = places_of(small)[:, 0]
    np.testing.assert_allclose(offsets, np.array(SMALL) - np.mean(SMALL), atol=0.05)
    assert small.is_corrected
    assert small.doubt is None
    assert small.warnings[0].startswith(
        "heads are not where the calibration says, and the scan was corrected: head 1 by"
    )
    assert small.after_mm < 0.9 * small.before_mm  # type: ignore[operator]  # both are known where heads are compared


def test_points_move_by_what_was_found(small: HeadsReport) -> None:
    points = points_of(SMALL)
    moved, planes = corrected(points, views(), small)
    of_lower = points["camera"] >= 5
    np.testing.assert_allclose((moved["x"] - points["x"])[of_lower].mean(), small.heads[2].offset_mm, atol=0.02)
    assert (moved["y"] == points["y"]).all()
    assert planes[5].plane is not None
    assert planes[5].plane.offset_mm == small.heads[2].offset_mm


def test_a_large_offset_puts_the_measures_in_doubt() -> None:
    report = find_heads(points_of((2.0, 0.0, 0.0)), views(), HeadParameters())
    np.testing.assert_allclose(places_of(report)[:, 0], [4 / 3, -2 / 3, -2 / 3], atol=0.15)
    assert report.doubt is not None
    assert "of a head lie" in report.doubt
    assert "film the body that shows the laser planes (`footscan calibrate film`" in report.doubt


@pytest.mark.parametrize(("lost_mm", "is_doubted"), [(0.0, False), (1.5, True)])
def test_a_head_that_loses_steps_puts_the_measures_in_doubt(lost_mm: float, is_doubted: bool) -> None:
    before, after = points_of((0.0, 0.0, 0.0)), points_of((0.0, -lost_mm, 0.0))
    half = float(np.median(before["plane"]))
    points = np.concatenate([before[before["plane"] <= half], after[after["plane"] > half]])
    report = find_heads(points, views(), HeadParameters())
    assert ("lost steps" in str(report.doubt)) == is_doubted
    assert (report.strays_mm > 0.05) == is_doubted


def test_a_turned_plane_is_found() -> None:
    report = find_heads(points_of((0.0, 0.0, 0.0), turn=0.008), views(), HeadParameters())
    yaw = places_of(report)[:, 1]
    assert yaw[0] - yaw[2] == pytest.approx(0.008, abs=0.003)
    assert report.is_corrected


def test_heads_whose_planes_were_filmed_are_corrected_if_that_explains_what_cameras_disagree_by() -> None:
    filmed = {
        camera: replace(view, plane=LaserPlane(head=HEADS[camera] + 1, sd=[0.01] * 7))
        for camera, view in views().items()
    }
    assert find_heads(points_of((0.0, 0.0, -0.15)), filmed, HeadParameters()).is_corrected
    warped = points_of((0.0, 0.0, 0.0))  # maps that err by a tenth of a millimetre
    random = np.random.default_rng(1)
    for camera in filmed:
        rows = warped["camera"] == camera
        tilt, lift, wave = random.normal(0.0, 0.1, 3)
        warped["y"][rows] += tilt * (warped["z"][rows] - 57.0) / 40.0
        warped["z"][rows] += lift * warped["y"][rows] / 40.0
        warped["y"][rows] += wave * np.sin(warped["y"][rows] / 20.0)
    assert find_heads(warped, views(), HeadParameters()).is_corrected
    report = find_heads(warped, filmed, HeadParameters())
    assert (report.is_corrected, report.doubt) == (False, None)


def test_heads_that_travel_one_after_the_other_are_not_trusted_if_they_are_off() -> None:
    """Without a common line, an offset and a scale may stand for each other."""
    report = find_heads(points_of((0.0, 0.0, -0.4), shared=False), views(), HeadParameters())
    assert report.is_corrected
    assert report.doubt is not None


def test_a_single_head_has_nothing_to_compare() -> None:
    points = points_of((0.0, 0.0, 0.0))
    report = find_heads(points[points["camera"] <= 2], views(), HeadParameters())
    assert report.heads == []
    assert report.points > 0


def test_no_points_and_no_wish_give_an_empty_report() -> None:
    points = points_of(SMALL)
    assert find_heads(points[:0], views(), HeadParameters()) == HeadsReport()
    assert find_heads(points, views(), HeadParameters(correct_heads=False)).heads == []

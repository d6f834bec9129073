"""A foot that trembles is moved back; one that stands still is not, whatever its form."""

from functools import cache

import numpy as np
import pytest

from footscan.cloud.movement.tremor import steadied
from footscan.cloud.points import make_points
from footscan.virtual.foot.foot import make_foot

STEP_MM, FRAMES = 2.0, 90  # up to the toes, whose sections are several
HEADS = {1: 1, 2: 2}


def scan(moved_mm: np.ndarray) -> np.ndarray:
    """Stripes of two cameras, one on either side of a foot that lies at `moved_mm` (2, F) along X for each of them."""
    parts = []
    for camera, side in ((1, 1.0), (2, -1.0)):
        for frame in range(FRAMES):
            plane = 8.0 + STEP_MM * frame
            section = section_at(plane - moved_mm[camera - 1, frame])
            section = section[side * (section[:, 0] - section[:, 0].mean()) > -10.0]
            angle = np.arctan2(section[:, 1] - section[:, 1].mean(), section[:, 0] - section[:, 0].mean())
            section = section[np.argsort(angle)]
            xyz = np.column_stack([np.full(len(section), plane), section])
            parts.append(make_points(xyz, camera, frame, source=np.arange(len(section))))
    return np.concatenate(parts)


@cache
def foot_edges() -> tuple[np.ndarray, np.ndarray]:
    """Both ends (E, 3) of each edge of a foot, mm."""
    foot = make_foot(resolution_mm=2.0)
    pairs = [foot.faces[:, list(pair)] for pair in ((0, 1), (1, 2), (2, 0))]
    edges = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    return foot.vertices[edges[:, 0]], foot.vertices[edges[:, 1]]


def section_at(x: float) -> np.ndarray:
    """(N, 2) Y and Z where the edges of the foot cross the plane at X = x, mm."""
    first, second = foot_edges()
    crosses = (first[:, 0] < x) != (second[:, 0] < x)
    first, second = first[crosses], second[crosses]
    share = (x - first[:, 0]) / (second[:, 0] - first[:, 0])
    return np.asarray((first + share[:, None] * (second - first))[:, 1:])


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


def test_points_that_show_nothing_are_left() -> None:
    for points in (np.empty(0, make_points(np.zeros((1, 3)), camera=1).dtype), scan(np.zeros((2, FRAMES)))[:40]):
        moved, report = steadied(points, HEADS)
        np.testing.assert_array_equal(moved, points)
        assert report.tremor_mm == 0.0

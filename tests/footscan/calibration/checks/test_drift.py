"""Drift of a camera whose map was moved by a known amount."""

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.calibration.capture.edge_points import EdgePoints
from footscan.calibration.capture.from_capture import CalibratedView
from footscan.calibration.checks.drift import Drift, drift_of
from schemas.calibration import CameraCalibration, PolynomialMap

REGION = [(0.0, 0.0), (600.0, 0.0), (600.0, 400.0), (0.0, 400.0)]


def plain(y: tuple[float, float, float], z: tuple[float, float, float]) -> CameraCalibration:
    plane = PolynomialMap(order=1, centre_px=(0, 0), scale_px=1, alpha_y=list(y), alpha_z=list(z))
    return CameraCalibration(camera=3, map=plane, region_px=REGION, points=9)


TODAY = plain((0, 0.25, 0), (0, 0, 0.25))


def view(shift_px: float = 0.0) -> CalibratedView:
    """Two edges of constant Z and two of constant Y, seen by a camera whose map is known."""
    along = np.linspace(5, 95, 40)
    level = np.column_stack([along, np.full(40, 20.0)]), np.column_stack([along, np.full(40, 80.0)])
    upright = np.column_stack([np.full(40, 20.0), along]), np.column_stack([np.full(40, 90.0), along])
    world = np.concatenate([*level, *upright])
    normals = np.repeat([[0.0, 1.0], [0.0, 1.0], [1.0, 0.0], [1.0, 0.0]], 40, axis=0)
    offsets = np.sum(world * normals, axis=1)
    zeros = np.zeros(160, np.intp)
    edge = np.repeat(np.arange(4), 40)
    points = EdgePoints(world / 0.25 + shift_px, zeros, edge, np.tile(along, 4), normals, offsets)
    return CalibratedView(TODAY, [], points, [])


def test_nothing_moved() -> None:
    drift = drift_of(TODAY, view(), 0.2)
    assert drift.verdict == "steady"
    assert (drift.points, drift.rms_mm) == (160, pytest.approx(0, abs=1e-9))


def test_a_shift_is_measured_in_both_directions_although_edges_are_seen_across_alone() -> None:
    moved = plain((0.3, 0.25, 0), (-0.4, 0, 0.25))
    drift = drift_of(moved, view(), 0.2)
    assert drift.verdict == "drifted"
    assert drift.shift_mm == pytest.approx((0.3, -0.4))
    assert (drift.rms_mm, drift.worst_mm) == (pytest.approx(0.5), pytest.approx(0.5))
    assert drift_of(moved, view(), 0.6).verdict == "steady"


def test_a_turn_is_larger_far_from_its_centre() -> None:
    turn = 0.002
    turned = plain((0, 0.25, -turn * 0.25), (0, turn * 0.25, 0.25))
    drift = drift_of(turned, view(), 0.05)
    world = view().points.pixels * 0.25
    lengths: NDArray[np.float64] = turn * np.hypot(world[:, 0], world[:, 1])
    assert drift.verdict == "drifted"
    assert drift.rms_mm == pytest.approx(np.sqrt(np.mean(lengths**2)), rel=1e-3)
    assert drift.worst_mm == pytest.approx(lengths.max(), rel=1e-3)


def test_points_that_the_calibration_does_not_support_do_not_count() -> None:
    aside = plain((0, 0.25, 0), (0, 0, 0.25)).model_copy(update={"region_px": [(900, 0), (990, 0), (990, 90)]})
    drift = drift_of(aside, view(), 0.2)
    assert (drift.verdict, drift.points, drift.rms_mm) == ("not comparable", 0, None)
    assert drift.remark == "0 of 160 points of the stripe lie where data support the calibration"


def test_a_map_that_is_not_finite_has_not_stayed() -> None:
    far = plain((0, 1e14, 0), (0, 0, 1e14))
    assert drift_of(far, view(), 0.2).verdict == "drifted"
    assert Drift(1, "not in the capture").rms_mm is None

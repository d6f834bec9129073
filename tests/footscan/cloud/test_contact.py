from dataclasses import dataclass

import numpy as np
import pytest

from footscan.cloud.contact import above_glass, estimate_glass, moved_warning
from footscan.cloud.points import make_points
from footscan.cloud.views import View
from schemas.glass import CALIBRATED, GlassPlane, Plane

BELOW, ABOVE = (5, 6, 7, 8), (1, 2)
VIEWS = {camera: View(np.array([0.0, 0.0, -140.0]), np.empty((0, 2))) for camera in BELOW}
VIEWS |= {camera: View(np.array([0.0, 0.0, 200.0]), np.empty((0, 2))) for camera in ABOVE}
CENTRE = np.array([130.0, 0.0])
"""Where the sole has its middle, mm."""


@dataclass
class Sole:
    """A sole on a plate, as cameras see it: pads under heel and ball lie on the glass, the rest is a bowl above it."""

    height: float = 0.0
    tilt_x: float = 0.0
    tilt_y: float = 0.0
    pads: tuple[tuple[float, float], ...] = ((40.0, 22.0), (190.0, 38.0))
    """X of each pad, and its radius, mm."""
    noise: float = 0.06
    errors: tuple[float, ...] = (0.02, -0.03, 0.01, -0.01)
    """Error in height of each camera."""
    every: int = 1
    """Only every so many points of a stripe are seen."""

    def glass(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        across, along = np.tan(np.radians([self.tilt_x, self.tilt_y]))
        return np.asarray(self.height - along * (x - CENTRE[0]) + across * (y - CENTRE[1]))

    def points(self, cameras: tuple[int, ...] = BELOW) -> np.ndarray:
        random = np.random.default_rng(3)
        x, y = (
            grid.ravel() for grid in np.meshgrid(np.arange(10.0, 250.0, 2.0), np.arange(-45.0, 45.0, 0.25 * self.every))
        )
        beside = np.min([np.hypot(x - place, y) - radius for place, radius in self.pads], axis=0)
        rise = 0.06 * np.maximum(beside, 0.0) ** 1.5
        parts = []
        for camera in cameras:
            z = self.glass(x, y) + rise + self.errors[BELOW.index(camera)] + random.normal(0.0, self.noise, len(x))
            parts.append(make_points(np.column_stack([x, y, z]), camera, (x / 2.0).astype(int)))
        return np.concatenate(parts)


def plane_error(glass: GlassPlane, sole: Sole) -> float:
    """Largest distance of the estimate from the true glass below the foot, mm."""
    x, y = np.array([10.0, 10.0, 250.0, 250.0]), np.array([-40.0, 40.0, -40.0, 40.0])
    height, along, across = glass.plane
    return float(np.abs(height + along * x + across * y - sole.glass(x, y)).max())


@pytest.mark.parametrize("height", [-2.0, -0.4, 0.3, 2.0])
@pytest.mark.parametrize("tilts", [(0.0, 0.0), (0.5, -0.5), (-0.5, 0.3)])
def test_height_and_tilt(height: float, tilts: tuple[float, float]) -> None:
    sole = Sole(height, *tilts)
    glass = estimate_glass(sole.points(), VIEWS)
    assert glass.corrected
    assert glass.supported == ["height", "tilt_y", "tilt_x"]
    assert plane_error(glass, sole) < 0.05
    assert 0.005 < (glass.below_foot_sd_mm or 0.0) < 0.03
    assert abs(glass.tilt_x_deg - sole.tilt_x) < 3.0 * (glass.tilt_x_sd_deg or 0.0) < 0.2
    assert abs(glass.tilt_y_deg - sole.tilt_y) < 3.0 * (glass.tilt_y_sd_deg or 0.0) < 0.1


def test_a_plate_in_its_place_is_left_there() -> None:
    glass = estimate_glass(Sole().points(), VIEWS)
    assert (glass.corrected, glass.plane) == (False, CALIBRATED)
    assert glass.contact_mm2 == pytest.approx(np.pi * (22.0**2 + 38.0**2), rel=0.25)
    assert glass.stripes == pytest.approx((2 * 22 + 2 * 38) / 2, abs=8)
    points = Sole().points()
    assert above_glass(points, glass.plane) is points


def test_more_points_do_not_make_it_more_certain() -> None:
    many, few = (estimate_glass(Sole(1.0, every=every).points(), VIEWS) for every in (1, 4))
    assert many.below_foot_sd_mm == pytest.approx(few.below_foot_sd_mm, rel=0.2)


def test_cameras_that_disagree_make_it_less_certain() -> None:
    agreeing, apart = (Sole(1.0, errors=tuple(f * np.array([0.1, -0.1, 0.1, -0.1]))) for f in (0.1, 1.0))
    sds = [estimate_glass(sole.points(), VIEWS).below_foot_sd_mm or 0.0 for sole in (agreeing, apart)]
    assert sds[1] > 2.0 * sds[0]
    assert sds[1] == pytest.approx(0.1 * np.sqrt(4 / 5) / 2, rel=0.2)  # 4 + 2 - 1 in the denominator; of 4 cameras


@pytest.mark.parametrize("least", [0.5, 1.5])
def test_a_sole_without_contact_shows_no_glass(least: float) -> None:
    sole = Sole(1.0)
    points = sole.points()
    lifted = points[points["z"] - sole.glass(points["x"], points["y"]) > least]
    assert estimate_glass(lifted, VIEWS) == GlassPlane()


@pytest.mark.parametrize("radius", [400.0, 1500.0])
def test_a_round_sole_shows_no_glass(radius: float) -> None:
    points = Sole(pads=((130.0, 300.0),)).points()
    points["z"] += (np.hypot(points["x"] - 130.0, points["y"]) ** 2 / (2.0 * radius)).astype(np.float32)
    assert estimate_glass(points, VIEWS) == GlassPlane()


def test_a_heel_alone_says_nothing_of_the_tilt_along_the_foot() -> None:
    sole = Sole(0.8)
    points = sole.points()
    points["z"] += (0.0005 * np.maximum(points["x"] - 75.0, 0.0) ** 2).astype(np.float32)  # the forefoot is raised
    glass = estimate_glass(points, VIEWS)
    assert glass.corrected
    assert "tilt_y" not in glass.supported
    assert (glass.tilt_y_deg, glass.tilt_y_sd_deg, glass.height_sd_mm) == (0.0, None, None)
    assert glass.below_foot_mm == pytest.approx(0.8, abs=0.05)


def test_a_knocked_camera_is_left_out() -> None:
    sole = Sole(-0.7, 0.2, errors=(0.02, -0.03, 1.4, -0.01))
    glass = estimate_glass(sole.points(), VIEWS)
    assert glass.cameras == [5, 6, 8]
    assert plane_error(glass, sole) < 0.05


def test_one_camera_is_no_witness() -> None:
    assert estimate_glass(Sole(1.0).points((5,)), VIEWS) == GlassPlane()
    assert estimate_glass(Sole(1.0).points((5, 8)), VIEWS).cameras == [5, 8]


def test_cameras_above_are_not_asked() -> None:
    points = Sole(1.0).points((5, 6))
    points["camera"] -= 4
    assert estimate_glass(points, VIEWS) == GlassPlane()
    assert estimate_glass(points[:0], VIEWS) == GlassPlane()
    assert estimate_glass(points, {}) == GlassPlane()


def test_ghosts_strays_and_marks_do_not_move_it() -> None:
    sole, random = Sole(1.2, 0.3, -0.2), np.random.default_rng(5)
    clean = sole.points()
    ghosts = clean[random.random(len(clean)) < 0.3].copy()
    ghosts["z"] += 4.4
    below = clean[random.random(len(clean)) < 0.1].copy()  # marks on the lower face
    below["z"] -= 5.0
    x, y, z = random.uniform([0.0, -60.0, -6.0], [260.0, 60.0, 6.0], (3000, 3)).T
    strays = make_points(np.column_stack([x, y, z]), random.choice(BELOW, 3000), (x / 2.0).astype(int))
    glass = estimate_glass(np.concatenate([clean, ghosts, below, strays]), VIEWS)
    assert glass.supported == ["height", "tilt_y", "tilt_x"]
    assert plane_error(glass, sole) < 0.05


def test_warnings() -> None:
    assert list(moved_warning(GlassPlane(below_foot_mm=0.3, largest_mm=0.4, corrected=True), 0.5)) == []
    assert list(moved_warning(GlassPlane(below_foot_mm=9.0, largest_mm=9.0), 0.5)) == []
    tilted = GlassPlane(below_foot_mm=-0.2, tilt_x_deg=0.4, tilt_x_sd_deg=0.02, largest_mm=0.9, corrected=True)
    (warning,) = moved_warning(tilted, 0.5)
    assert warning == (
        "The sole stands 0.20 mm below the calibrated glass, tilted by 0.40 degrees about X: "
        "the plate was moved since the calibration; calibrate anew"
    )
    about_both = tilted.model_copy(update={"tilt_y_deg": -0.1, "tilt_y_sd_deg": 0.02})
    assert "0.40 degrees about X and -0.10 degrees about Y" in next(moved_warning(about_both, 0.5))


def test_heights_above_a_tilted_glass() -> None:
    sole = Sole(1.0, 0.5, -0.5)
    x, y = np.array([20.0, 200.0]), np.array([-30.0, 30.0])
    points = make_points(np.column_stack([x, y, sole.glass(x, y) + 7.0]), 5)
    across, along = np.tan(np.radians([0.5, -0.5]))
    raised = above_glass(points, Plane(1.0 + along * CENTRE[0], -along, across))
    np.testing.assert_allclose(raised["z"], 7.0, atol=1e-4)
    np.testing.assert_array_equal(raised["x"], points["x"])

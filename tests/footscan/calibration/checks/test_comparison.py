"""Comparison of two calibrations, on maps whose differences are worked out by hand."""

from typing import Any

import numpy as np
import pytest

from footscan.calibration.checks.comparison import CameraComparison, compare_calibrations, worst_beyond
from footscan.calibration.models.homography import HomographyModel
from schemas.base.units import Point
from schemas.calibration import Calibration, CameraCalibration, PixelMap, PolynomialMap

Box = tuple[float, float, float, float]
A_TENTH = ([0.0, 0.1, 0.0], [0.0, 0.0, 0.1])
"""Y = 0.1 i and Z = 0.1 j."""
SQUARE: Box = (100, 100, 200, 200)
"""101 x 101 whole pixels; the variance of 101 whole numbers in a row is (101^2 - 1) / 12 = 850."""


def affine(alpha_y: list[float], alpha_z: list[float], centre_px: Point = (0.0, 0.0)) -> PolynomialMap:
    """Y and Z from 1, i - centre_i, j - centre_j."""
    return PolynomialMap(order=1, centre_px=centre_px, scale_px=1.0, alpha_y=alpha_y, alpha_z=alpha_z)


def calibrated(pixel_map: PixelMap, box: Box | None = SQUARE, camera: int = 1, **more: Any) -> CameraCalibration:
    """A camera whose region is the box (i and j at its first and at its last corner)."""
    region = [] if box is None else [(box[0], box[1]), (box[2], box[1]), (box[2], box[3]), (box[0], box[3])]
    return CameraCalibration(camera=camera, map=pixel_map, region_px=region, points=9, **more)


def compared(a: CameraCalibration, b: CameraCalibration) -> CameraComparison:
    [found] = compare_calibrations(calibration(a), calibration(b))
    return found


def calibration(*cameras: CameraCalibration) -> Calibration:
    return Calibration(sources=[], software="test", cameras=list(cameras))


def test_a_shift() -> None:
    found = compared(calibrated(affine(*A_TENTH)), calibrated(affine([0.3, 0.1, 0.0], [-0.4, 0.0, 0.1])))
    assert (found.camera, found.model_a, found.model_b) == (1, "polynomial 1", "polynomial 1")
    assert (found.shared_fraction, found.pixels, found.remarks) == (1.0, 101 * 101, ())
    assert found.mean_y_mm == pytest.approx(0.3)
    assert found.mean_z_mm == pytest.approx(-0.4)
    assert found.rms_mm == pytest.approx(0.5)
    assert found.largest_mm == pytest.approx(0.5)
    assert found.turn_deg == pytest.approx(0, abs=1e-12)
    assert found.left_rms_mm == pytest.approx(0, abs=1e-12)


def test_a_scale() -> None:
    """B minus A is (0.001 (i - 140), 0.001 (j - 150)): its mean is (0.01, 0), its largest at i = 200."""
    found = compared(
        calibrated(affine(*A_TENTH, (140.0, 150.0))),
        calibrated(affine([0.0, 0.101, 0.0], [0.0, 0.0, 0.101], (140.0, 150.0))),
    )
    assert found.mean_y_mm == pytest.approx(0.01)
    assert found.mean_z_mm == pytest.approx(0.0, abs=1e-12)
    assert found.rms_mm == pytest.approx(np.sqrt(0.01**2 + 2 * 850 * 0.001**2))
    assert found.largest_mm == pytest.approx(np.hypot(0.06, 0.05))
    assert found.largest_at_px in ((200, 100), (200, 200))
    assert found.turn_deg == pytest.approx(0, abs=1e-12)
    assert found.left_rms_mm == pytest.approx(np.sqrt(2 * 850) * 0.001)


@pytest.mark.parametrize("degrees", [2.0, -90.0, 179.0])
def test_a_turn_and_a_shift_leave_nothing(degrees: float) -> None:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    turned = affine([7.0, 0.1 * c, -0.1 * s], [-3.0, 0.1 * s, 0.1 * c])
    found = compared(calibrated(affine(*A_TENTH)), calibrated(turned))
    assert found.turn_deg == pytest.approx(degrees)
    assert found.left_rms_mm == pytest.approx(0, abs=1e-10)
    assert found.rms_mm is not None
    assert found.rms_mm > 1


def test_the_sign_is_that_of_b_minus_a() -> None:
    a, b = calibrated(affine(*A_TENTH)), calibrated(affine([0.3, 0.1, 0.001], [-0.4, -0.001, 0.1]))
    there, back = compared(a, b), compared(b, a)
    for figure in ("mean_y_mm", "mean_z_mm", "turn_deg"):
        assert getattr(there, figure) == pytest.approx(-getattr(back, figure), rel=1e-9)
    assert (there.rms_mm, there.largest_mm, there.largest_at_px) == (back.rms_mm, back.largest_mm, back.largest_at_px)


@pytest.mark.parametrize("kind", range(6))
def test_a_homography_and_itself(pinhole: Any, all_models: list[HomographyModel], kind: int) -> None:
    model = all_models[kind]
    camera = calibrated(model.as_map(pinhole().parameters(model)), (20, 30, 610, 450), image_px=(640, 480))
    found = compared(camera, camera)
    assert (found.mean_y_mm, found.mean_z_mm, found.rms_mm, found.largest_mm) == (0, 0, 0, 0)
    assert (found.turn_deg, found.left_rms_mm) == (0, pytest.approx(0, abs=1e-12))
    assert (found.shared_fraction, found.pixels, found.remarks) == (1.0, 591 * 421, ())


def test_models_by_the_names_of_the_tables(pinhole: Any, all_models: list[HomographyModel]) -> None:
    cameras = [
        calibrated(model.as_map(pinhole().parameters(model)), camera=k + 1) for k, model in enumerate(all_models)
    ]
    found = compare_calibrations(calibration(*cameras), calibration(calibrated(affine(*A_TENTH))))
    assert [camera.model_a for camera in found] == [
        "homography",
        "homography, distortion",
        "homography, correction 2",
        "homography, distortion, correction 2",
        "homography, distortion, correction 3",
        "homography, distortion, correction 5",
    ]
    assert [camera.model_b for camera in found] == ["polynomial 1"] + 5 * [None]


def test_only_the_shared_region_counts() -> None:
    """Columns 100 to 200 and 150 to 250 share 51 of 151 columns; there B minus A is 0.01 (i - 150)."""
    a, b = affine(*A_TENTH), affine([-1.5, 0.11, 0.0], [0.0, 0.0, 0.1])
    found = compared(calibrated(a), calibrated(b, (150, 100, 250, 200)))
    assert found.shared_fraction == pytest.approx(51 / 151)
    assert found.pixels == 51 * 101
    assert found.mean_y_mm == pytest.approx(0.25)
    assert found.largest_mm == pytest.approx(0.5)
    assert found.largest_at_px is not None
    assert found.largest_at_px[0] == 200


@pytest.mark.parametrize("box", [(300, 100, 400, 200), (200.4, 200.4, 200.6, 200.6)])
def test_regions_that_share_nothing(box: Box) -> None:
    found = compared(calibrated(affine(*A_TENTH)), calibrated(affine(*A_TENTH), box))
    assert (found.shared_fraction, found.pixels, found.rms_mm, found.largest_at_px) == (0.0, 0, None, None)
    assert found.remarks == ("the regions share no pixel",)


def test_regions_without_a_whole_pixel() -> None:
    small = calibrated(affine(*A_TENTH), (0.4, 0.4, 0.6, 0.6))
    found = compared(small, small)
    assert (found.shared_fraction, found.pixels, found.rms_mm) == (0.0, 0, None)


@pytest.mark.parametrize("unknown", ["A", "B"])
def test_where_one_region_is_not_known_the_others_counts(unknown: str) -> None:
    without, with_region = calibrated(affine(*A_TENTH), None), calibrated(affine([0.3, 0.1, 0.0], [0.0, 0.0, 0.1]))
    found = compared(without, with_region) if unknown == "A" else compared(with_region, without)
    assert (found.shared_fraction, found.pixels) == (None, 101 * 101)
    assert found.rms_mm == pytest.approx(0.3)
    assert found.remarks == (f"{unknown} does not say its region: compared over that of the other",)


@pytest.mark.parametrize(
    ("image_a_px", "image_b_px", "pixels"),
    [
        (None, None, 640 * 480),
        ((320, 240), None, 320 * 240),
        (None, (320, 240), 320 * 240),
        ((320, 240), (200, 300), 200 * 240),
        ((1600, 800), None, 800 * 800),  # every second column
    ],
)
def test_where_no_region_is_known_the_image_counts(image_a_px: Any, image_b_px: Any, pixels: int) -> None:
    a = calibrated(affine(*A_TENTH), None, image_px=image_a_px)
    found = compared(a, calibrated(affine(*A_TENTH), None, image_px=image_b_px))
    assert (found.shared_fraction, found.pixels, found.rms_mm) == (None, pixels, 0)
    assert found.remarks[-1] == "neither says its region: compared over the image"
    assert (found.image_a_px, found.image_b_px) == (image_a_px, image_b_px)


def test_different_images_are_told() -> None:
    a, b = (calibrated(affine(*A_TENTH), image_px=image_px) for image_px in ((640, 480), (1280, 720)))
    assert compared(a, b).remarks == ("A holds for images of 640 x 480 pixels, B for 1280 x 720",)
    assert compared(a, a).remarks == compared(a, calibrated(affine(*A_TENTH))).remarks == ()


def homography(horizon_i: float, bend: float = 1.0) -> PixelMap:
    """(Y, Z) = (i, j) / w with w = 1 - i / horizon_i."""
    return HomographyModel((0.0, 0.0), 1.0).as_map(np.array([bend, 0, 0, 0, bend, 0, -1 / horizon_i, 0]))


def test_a_horizon_within_the_shared_region_has_no_figures() -> None:
    a, b = calibrated(homography(1000.0)), calibrated(homography(150.0))
    found = compared(a, b)
    assert (found.pixels, found.rms_mm, found.largest_mm, found.left_rms_mm) == (101 * 101, None, None, None)
    assert found.remarks == ("B would place pixels more than a kilometre away",)
    assert compared(b, b).remarks == ("A and B would place pixels more than a kilometre away",)


def test_a_horizon_between_pixels_is_told() -> None:
    """Before it and beyond it the map turns another way round."""
    found = compared(calibrated(homography(1000.0)), calibrated(homography(150.5)))
    assert found.remarks == ("B takes several pixels to one place",)
    assert found.rms_mm is not None


def test_a_horizon_beyond_the_shared_region_does_not_matter() -> None:
    """At i = 200, j = 200: 200 / (1 - 200 / 1000) = 250 in A, for Y and Z, and 200 / (1 - 200 / 400) = 400 in B."""
    a, b = calibrated(homography(1000.0), (100, 100, 800, 200)), calibrated(homography(400.0))
    found = compared(a, b)
    assert found.remarks == ()
    assert found.shared_fraction == pytest.approx(101 / 701)
    assert found.largest_mm == pytest.approx(150 * np.sqrt(2))
    assert found.largest_at_px == (200, 200)


def test_a_fold_is_told_and_compared() -> None:
    """Y = 0.001 (i - 150)^2 + 0.1 has its fold at i = 150."""
    folded = PolynomialMap(
        order=2, centre_px=(150.0, 0.0), scale_px=1.0, alpha_y=[0.1, 0, 0, 0.001, 0, 0], alpha_z=[0, 0, 0.1, 0, 0, 0]
    )
    found = compared(calibrated(affine([0.1, 0.0, 0.0], [0.0, 0.0, 0.1])), calibrated(folded))
    assert found.remarks == ("A takes several pixels to one place", "B takes several pixels to one place")
    assert found.mean_y_mm == pytest.approx(0.85)  # 0.001 times the variance
    assert found.largest_mm == pytest.approx(2.5)


def test_the_largest_numbers_that_a_file_may_hold() -> None:
    """Neither a warning nor a figure."""
    wild = HomographyModel((1e9, 1e9), 1e-9, True, 5).as_map(np.full(48, -1e15))
    found = compared(calibrated(affine(*A_TENTH)), calibrated(wild, (-1e9, -1e9, 1e9, 1e9)))
    assert found.rms_mm is None
    found = compared(calibrated(wild, (-1e9, -1e9, 1e9, 1e9)), calibrated(wild, (-1e9, -1e9, 1e9, 1e9)))
    assert found.remarks == ("A and B would place pixels more than a kilometre away",)


def test_cameras_of_one_calibration_alone() -> None:
    a = calibration(*(calibrated(affine(*A_TENTH), camera=camera) for camera in (7, 2)))
    b = calibration(*(calibrated(affine(*A_TENTH), camera=camera) for camera in (3, 2)))
    found = compare_calibrations(a, b)
    assert [camera.camera for camera in found] == [2, 3, 7]
    assert [camera.remarks for camera in found] == [(), ("in B alone",), ("in A alone",)]
    assert [(camera.model_a, camera.model_b) for camera in found[1:]] == [
        (None, "polynomial 1"),
        ("polynomial 1", None),
    ]
    assert [camera.rms_mm for camera in found] == [0, None, None]


def test_the_worst_camera() -> None:
    def shifted(**by_camera: float) -> Calibration:
        """Cameras c1, c2, ... shifted in Y by so many mm."""
        return calibration(
            *(calibrated(affine([s, 0.1, 0], [0, 0, 0.1]), camera=int(c[1:])) for c, s in by_camera.items())
        )

    found = compare_calibrations(shifted(c1=0, c2=0, c3=0), shifted(c1=0.125, c2=-0.5, c3=0.25))
    worst = worst_beyond(found, 0.2)
    assert worst is not None
    assert worst.camera == 2
    assert worst_beyond(found, 0.51) is None
    assert worst_beyond(found, float("nan")) is not None
    missing = worst_beyond(compare_calibrations(shifted(c1=0, c2=0), shifted(c1=9, c3=0)), 100.0)
    assert missing is not None
    assert (missing.camera, missing.rms_mm) == (2, None)

import numpy as np
import pytest

from footscan.calibration.models.uncertainty import END_ERROR, standard_deviations
from footscan.stripe.points import STRIPE_DTYPE
from schemas.calibration import CameraCalibration, PolynomialMap

MIDDLE = 200
"""The middle of 401 points, far enough from the ends that these hardly count."""


def camera(**more: object) -> CameraCalibration:
    """0.3 mm a column in Y and 0.2 mm a row in Z."""
    pixel_map = PolynomialMap(
        order=1, centre_px=(0.0, 0.0), scale_px=1.0, alpha_y=[0.0, 0.3, 0.0], alpha_z=[0.0, 0.0, 0.2]
    )
    return CameraCalibration(camera=1, map=pixel_map, region_px=[], points=9, **more)


def stripe(direction: tuple[float, float], sigma: float, width: float = 0.0) -> np.ndarray:
    """401 points, 1 px apart, in one frame."""
    points = np.zeros(2 * MIDDLE + 1, STRIPE_DTYPE)
    points["i"], points["j"] = np.outer(direction, np.arange(len(points)))
    points["sigma"], points["width"] = sigma, width
    return points


def test_the_scale_is_that_across_the_stripe() -> None:
    assert standard_deviations(stripe((1, 0), 0.05), camera())[MIDDLE] == pytest.approx(0.05 * 0.2)
    assert standard_deviations(stripe((0, 1), 0.05), camera())[MIDDLE] == pytest.approx(0.05 * 0.3)
    # Along (3, 4) / 5, J t is (0.18, 0.16) and det J 0.06.
    slanted = standard_deviations(stripe((0.6, 0.8), 0.05), camera())[MIDDLE]
    assert slanted == pytest.approx(0.05 * 0.06 / np.hypot(0.18, 0.16), rel=1e-6)


def test_a_calibration_is_as_good_as_on_what_was_held_out() -> None:
    # 0.2 mm/px times 0.05 px and 0.0173 mm: sqrt(0.0001 + 0.0003) = 0.02
    left = camera(rms_mm=0.001, held_out_rms_mm=np.sqrt(3e-4))
    assert standard_deviations(stripe((1, 0), 0.05), left)[MIDDLE] == pytest.approx(0.02)
    assert standard_deviations(stripe((1, 0), 0.0), camera(rms_mm=0.05))[MIDDLE] == pytest.approx(0.05)


def test_a_calibration_that_is_less_sure_by_its_covariance_is_so() -> None:
    # The constant terms of Y and Z have 0.1 mm and 0.3 mm, all others are sure.
    variances = [0.1**2, 0.0, 0.0, 0.3**2, 0.0, 0.0]
    unsure = camera(held_out_rms_mm=0.01, covariance=[[0.0] * k + [variance] for k, variance in enumerate(variances)])
    assert standard_deviations(stripe((1, 0), 0.0), unsure)[MIDDLE] == pytest.approx(0.3)
    assert standard_deviations(stripe((0, 1), 0.0), unsure)[MIDDLE] == pytest.approx(0.1)


def test_ends_of_a_stripe_are_less_sure() -> None:
    sigma = standard_deviations(stripe((1, 0), 0.0, width=5.0), camera())
    assert sigma[0] == sigma[-1] == pytest.approx(END_ERROR * 5.0 * 0.2)
    assert sigma[4] == pytest.approx(sigma[0] / 2)  # 0.8 widths from the end
    assert np.all(np.diff(sigma[: MIDDLE + 1]) < 0)

    torn = stripe((1, 0), 0.0, width=5.0)
    torn["i"][100:] += 30.0
    assert standard_deviations(torn, camera())[[99, 100]] == pytest.approx(sigma[0])
    torn["frame"][300:] = 1
    assert standard_deviations(torn, camera())[[299, 300]] == pytest.approx(sigma[0])


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_points(count: int) -> None:
    few = stripe((1, 0), 0.05)[:count]
    assert np.isfinite(standard_deviations(few, camera())).all()
    few["i"] = few["j"] = 7.0  # one on the other
    assert np.isfinite(standard_deviations(few, camera())).all()

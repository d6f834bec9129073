import numpy as np
import pytest

from footscan.cloud.mapping import map_stripe
from footscan.cloud.points import coordinates
from footscan.stripe.points import STRIPE_DTYPE
from schemas.base.errors import RefusedInput
from schemas.calibration import CameraCalibration, PolynomialMap
from schemas.parameters.mapping import MappingParameters

CAMERA = CameraCalibration(
    camera=4,
    map=PolynomialMap(
        order=1, centre_px=(320.0, 240.0), scale_px=100.0, alpha_y=[5.0, 10.0, 0.0], alpha_z=[50.0, 0.0, -20.0]
    ),
    region_px=[(300.0, 200.0), (400.0, 200.0), (400.0, 300.0), (300.0, 300.0)],
    points=9,
)


def stripe(*rows: tuple[int, float, float]) -> np.ndarray:
    points = np.zeros(len(rows), STRIPE_DTYPE)
    for name, column in zip(("frame", "i", "j"), zip(*rows, strict=True), strict=False):
        points[name] = column
    points["sigma"] = 0.1
    return points


def test_world_points_by_hand() -> None:
    x_of_frame = np.array([0.0, 2.0, 4.5])
    points = map_stripe(stripe((0, 320.0, 240.0), (2, 420.0, 290.0)), CAMERA, x_of_frame, MappingParameters())
    # y = 5 + 10 u, z = 50 - 20 v with u = (i - 320) / 100, v = (j - 240) / 100
    np.testing.assert_allclose(coordinates(points), [[0.0, 5.0, 50.0], [4.5, 15.0, 40.0]], atol=1e-5)
    assert points["source"].tolist() == [0, 1]
    assert points["frame"].tolist() == [0, 2]
    assert set(points["camera"].tolist()) == {4}
    # Each stands alone, along the columns: 0.1 px across that, at 0.2 mm/px.
    np.testing.assert_allclose(points["sigma"], 0.1 * 0.2, rtol=1e-6)


def test_points_far_from_all_control_points_are_marked_and_kept() -> None:
    near_and_far = stripe((0, 350.0, 250.0), (0, 405.0, 250.0), (0, 600.0, 250.0))
    points = map_stripe(near_and_far, CAMERA, np.zeros(1), MappingParameters(margin_px=10.0))
    assert points["supported"].tolist() == [True, True, False]


def test_no_stripe_no_points() -> None:
    assert len(map_stripe(stripe(), CAMERA, np.zeros(3), MappingParameters())) == 0


def test_a_frame_without_x_is_refused() -> None:
    with pytest.raises(RefusedInput, match=r"camera 4: positions: .*up to 3.*found 2"):
        map_stripe(stripe((3, 320.0, 240.0)), CAMERA, np.zeros(2), MappingParameters())

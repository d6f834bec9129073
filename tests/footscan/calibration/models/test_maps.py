"""Maps of a calibrated camera: there and back again, and their uncertainty."""

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from footscan.calibration.models.homography import HomographyModel
from footscan.calibration.models.maps import Model, is_supported, model_of, prediction_covariance, to_pixels, to_world
from footscan.calibration.models.polynomial import PolynomialModel, design_matrix
from footscan.calibration.models.region import region_of
from schemas.calibration import CameraCalibration

CENTRE, SCALE = (319.5, 239.5), float(np.hypot(319.5, 239.5))

KINDS = [
    *(f"polynomial {order}" for order in (1, 2, 3, 4, 5)),
    "homography",
    "homography, distortion",
    *(f"homography, distortion, correction {order}" for order in (2, 3, 4)),
    "homography, correction 5",
]


def calibrated(
    model: Model, parameters: np.ndarray, region: np.ndarray | None = None, **more: Any
) -> CameraCalibration:
    return CameraCalibration(
        camera=1,
        image_px=(640, 480),
        map=model.as_map(parameters),
        region_px=[] if region is None else region_of(region),
        points=9,
        **more,
    )


def parameters_of(kind: str, pinhole: Any, region: np.ndarray, bend: np.ndarray) -> tuple[Model, np.ndarray]:
    """A model of the kind that looks as the pinhole does; `bend` (40,) in -1 to 1 bends it."""
    if kind.startswith("polynomial"):
        order = int(kind[-1])
        low, high = region.min(axis=0), region.max(axis=0)
        centre, extent = (low + high) / 2, float((high - low).max() / 2)
        model = PolynomialModel(order, (float(centre[0]), float(centre[1])), extent)
        i, j = np.meshgrid(np.linspace(low[0], high[0], 12), np.linspace(low[1], high[1], 12))
        pixels = np.column_stack([i.ravel(), j.ravel()])
        matrix = design_matrix(*((pixels - centre) / extent).T, order)
        return model, np.linalg.lstsq(matrix, pinhole.world(pixels), rcond=None)[0].T.ravel()
    correction = int(kind[-1]) if "correction" in kind else None
    homography = HomographyModel(CENTRE, SCALE, "distortion" in kind, correction)
    parameters = pinhole.parameters(homography)
    in_focal_lengths = SCALE / pinhole.focal_px
    if homography.distorted:
        parameters[8] = (-0.025 + 0.125 * bend[0]) * in_focal_lengths**2  # k1 from -0.15 to 0.1
        parameters[9:12] = bend[1:4] * [0.05 * in_focal_lengths**4, 0.002, 0.002]
    if correction is not None:
        own = 8 + 4 * homography.distorted
        parameters[own:] = 0.2 * bend[4 : 4 + homography.unknowns - own]  # mm, at a corner of the image
    return homography, parameters


@settings(max_examples=150, deadline=None)
@given(
    kind=st.sampled_from(KINDS),
    distance=st.floats(250, 400),
    bearing=st.floats(0, 360),
    roll=st.floats(-180, 180),
    focal=st.floats(900, 1100),
    seed=st.integers(0, 2**32 - 1),
    corners=st.integers(3, 12),
)
def test_there_and_back_again(
    pinhole: Any, kind: str, distance: float, bearing: float, roll: float, focal: float, seed: int, corners: int
) -> None:
    """Every pixel of the region comes back within 0.01 px."""
    generator = np.random.default_rng(seed)
    region = generator.uniform([0, 0], [639, 479], (corners, 2))
    extent = np.ptp(region, axis=0)
    assume(extent.min() > 20)
    station = pinhole(distance_mm=distance, bearing_deg=bearing, roll_deg=roll, focal_px=focal)
    camera = calibrated(*parameters_of(kind, station, region, generator.uniform(-1, 1, 40)), region)
    inside = generator.dirichlet(np.ones(corners), 100) @ region
    pixels = np.concatenate([region, inside])
    assert is_supported(camera, pixels, 1e-6).all()
    back = to_pixels(camera, to_world(camera, pixels))
    np.testing.assert_allclose(back, pixels, atol=0.01, rtol=0)


def test_a_camera_whose_images_are_known_needs_no_region(pinhole: Any) -> None:
    model = HomographyModel(CENTRE, SCALE)
    camera = calibrated(model, pinhole().parameters(model))
    pixels = np.random.default_rng(1).uniform([0, 0], [639, 479], (200, 2))
    np.testing.assert_allclose(to_pixels(camera, pinhole().world(pixels)), pixels, atol=1e-6)


def test_by_hand() -> None:
    model = PolynomialModel(1, (320.0, 240.0), 100.0)
    camera = calibrated(model, np.array([5.0, 10.0, 0.0, 50.0, 0.0, -20.0]))
    # Y = 5 + 10 u, Z = 50 - 20 v
    np.testing.assert_allclose(to_world(camera, np.array([[420, 290]])), [[15, 40]], rtol=1e-15)
    np.testing.assert_allclose(to_pixels(camera, np.array([[15.0, 40.0], [5.0, 50.0]])), [[420, 290], [320, 240]])
    np.testing.assert_allclose(to_world(camera, np.array([[420.0, 290.0]], np.float32)), [[15, 40]])


def test_what_no_pixel_shows_is_not_a_number() -> None:
    model = PolynomialModel(2, (0.0, 0.0), 1.0)
    # Y = u^2 is never -1
    camera = calibrated(model, np.array([0, 0, 0, 1.0, 0, 0, 0, 0, 1.0, 0, 0, 0]), np.array([[1, 1], [5, 1], [1, 5.0]]))
    pixels = to_pixels(camera, np.array([[-1.0, 2.0], [9.0, 4.0], [np.nan, 0.0], [np.inf, 0.0]]))
    assert np.isnan(pixels).all(axis=1).tolist() == [True, False, True, True]
    np.testing.assert_allclose(pixels[1], [3, 4], atol=1e-6)


def test_nothing_in_nothing_out(pinhole: Any) -> None:
    model = HomographyModel(CENTRE, SCALE)
    camera = calibrated(model, pinhole().parameters(model))
    none = np.empty((0, 2))
    assert to_world(camera, none).shape == to_pixels(camera, none).shape == (0, 2)
    assert is_supported(camera, none).shape == (0,)


@pytest.mark.parametrize("kind", KINDS)
def test_the_file_says_the_same(kind: str, pinhole: Any) -> None:
    generator = np.random.default_rng(3)
    region = np.array([[0, 0], [639, 0], [639, 479], [0, 479.0]])
    model, parameters = parameters_of(kind, pinhole(), region, generator.uniform(-1, 1, 40))
    camera = calibrated(model, parameters, region)
    again = CameraCalibration.model_validate_json(camera.model_dump_json())
    assert again == camera
    assert model_of(again.map)[0] == model
    np.testing.assert_array_equal(model_of(again.map)[1], parameters)
    pixels = generator.uniform(0, 480, (20, 2))
    np.testing.assert_array_equal(to_world(again, pixels), model.world(parameters, pixels))


def test_covariance_by_hand() -> None:
    model = PolynomialModel(1, (0.0, 0.0), 1.0)
    # alpha = 1, u, v for Y and for Z; Y's constant has variance 4 and its slope in u 1, with covariance 0.5;
    # Z's constant has variance 9 and covariance -1 with Y's
    triangle = [[4.0], [0.5, 1.0], [0, 0, 0], [-1.0, 0, 0, 9.0], [0] * 5, [0] * 6]
    camera = calibrated(model, np.zeros(6), covariance=triangle)
    found = prediction_covariance(camera, np.array([[0, 7], [2, 3]]))
    assert found is not None
    # at u = 2: 4 + 2 * 2 * 0.5 + 4 * 1 = 10
    np.testing.assert_allclose(found, [[[4, -1], [-1, 9]], [[10, -1], [-1, 9]]], rtol=1e-14)


def test_unknown_covariance_is_none() -> None:
    assert prediction_covariance(calibrated(PolynomialModel(1, (0, 0), 1), np.zeros(6)), np.zeros((3, 2))) is None


def test_support_is_the_regions() -> None:
    camera = calibrated(PolynomialModel(1, (0, 0), 1), np.zeros(6), np.array([[0, 0], [4, 0], [0, 4.0]]))
    pixels = np.array([[1, 1], [2.1, 2.1], [3, 3]])
    assert is_supported(camera, pixels).tolist() == [True, False, False]
    assert is_supported(camera, pixels, 0.15).tolist() == [True, True, False]

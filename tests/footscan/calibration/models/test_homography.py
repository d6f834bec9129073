"""Homographies with what bends them: by hand, against finite differences, exact on exact data."""

from typing import Any

import numpy as np
import pytest

from footscan.calibration.models.homography import HomographyModel, algebraic_homography

MODELS = range(6)


def parameters_of(model: HomographyModel, pinhole: Any, seed: int = 0) -> np.ndarray:
    """A realistic camera with a lens and a correction."""
    parameters = pinhole(roll_deg=20.0).parameters(model)
    generator = np.random.default_rng(seed)
    if model.distorted:
        parameters[8:12] = [-0.024, 0.004, 0.001, -0.002]
    if model.correction is not None:
        own = 8 + 4 * model.distorted
        parameters[own:] = generator.uniform(-0.5, 0.5, model.unknowns - own)
    return parameters


def test_unknowns() -> None:
    counts = [
        HomographyModel((0, 0), 1, distorted, correction).unknowns
        for distorted in (False, True)
        for correction in (None, 2, 3, 4, 5)
    ]
    # a correction of order 2 has 3 terms for each of Y and Z, of order 3 7, of order 4 12, of order 5 18
    assert counts == [8, 14, 22, 32, 44, 12, 18, 26, 36, 48]


def test_plain_homography_by_hand() -> None:
    model = HomographyModel((10.0, 20.0), 5.0)
    parameters = np.array([4.0, 0.0, 6.0, 1.0, 2.0, 3.0, 0.5, 0.25])
    # (20, 10): u = 2, v = -2: depth 1 + 1 - 0.5 = 1.5, Y = 14 / 1.5, Z = (2 - 4 + 3) / 1.5; the centre: 6 and 3
    world = model.world(parameters, np.array([[20.0, 10.0], [10.0, 20.0]]))
    np.testing.assert_allclose(world, [[28 / 3, 2 / 3], [6, 3]], rtol=1e-15)


def test_distortion_by_hand() -> None:
    model = HomographyModel((0.0, 0.0), 1.0, True)
    identity = [1.0, 0, 0, 0, 1.0, 0, 0, 0]
    pixel = np.array([[1.0, 2.0]])  # r^2 = 5
    for k, expected in (
        ([0.1, 0, 0, 0], [1 + 0.1 * 5, 2 + 2 * 0.1 * 5]),
        ([0, 0.01, 0, 0], [1 + 0.01 * 25, 2 + 2 * 0.01 * 25]),
        ([0, 0, 0.1, 0], [1 + 2 * 0.1 * 2, 2 + 0.1 * (5 + 8)]),
        ([0, 0, 0, 0.1], [1 + 0.1 * (5 + 2), 2 + 2 * 0.1 * 2]),
    ):
        np.testing.assert_allclose(model.world(np.array(identity + k), pixel), [expected], rtol=1e-14)


def test_correction_by_hand() -> None:
    model = HomographyModel((0.0, 0.0), 1.0, False, 2)
    parameters = np.array([1.0, 0, 0, 0, 1.0, 0, 0, 0, 0.1, 0.2, 0.3, 1.0, 2.0, 3.0])
    # u = 2, v = 3: u^2 = 4, uv = 6, v^2 = 9: 0.4 + 1.2 + 2.7 = 4.3 and 43 on top of (2, 3)
    np.testing.assert_allclose(model.world(parameters, np.array([[2.0, 3.0]])), [[6.3, 46]], rtol=1e-14)


def test_is_the_image_of_a_pinhole(pinhole: Any, all_models: list[HomographyModel]) -> None:
    camera = pinhole()
    pixels = np.random.default_rng(1).uniform(0, 480, (100, 2))
    np.testing.assert_allclose(
        all_models[0].world(camera.parameters(all_models[0]), pixels), camera.world(pixels), rtol=1e-12, atol=1e-11
    )
    # The middle of the image shows what the camera looks at; there, 1 px is 300 mm / 1000 px across the view.
    np.testing.assert_allclose(camera.world(np.array([[319.5, 239.5]])), [[10, 40]], atol=1e-9)
    slope = all_models[0].by_pixels(camera.parameters(all_models[0]), np.array([[319.5, 239.5]]))[0]
    assert np.linalg.svd(slope)[1][1] == pytest.approx(0.3, rel=1e-9)


@pytest.mark.parametrize("number", MODELS)
def test_derivatives_by_parameters(number: int, pinhole: Any, all_models: list[HomographyModel]) -> None:
    model = all_models[number]
    parameters = parameters_of(model, pinhole)
    pixels = np.random.default_rng(2).uniform([0, 0], [639, 479], (40, 2))
    jacobian = model.by_parameters(parameters, pixels)
    assert jacobian.shape == (40, 2, model.unknowns)
    for p in range(model.unknowns):
        step = np.eye(model.unknowns)[p] * max(1e-5, 1e-6 * abs(parameters[p]))
        change = model.world(parameters + step, pixels) - model.world(parameters - step, pixels)
        np.testing.assert_allclose(jacobian[:, :, p], change / (2 * step[p]), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("number", MODELS)
def test_derivatives_by_pixels(number: int, pinhole: Any, all_models: list[HomographyModel]) -> None:
    model = all_models[number]
    parameters = parameters_of(model, pinhole)
    pixels = np.random.default_rng(3).uniform([0, 0], [639, 479], (40, 2))
    slope = model.by_pixels(parameters, pixels)
    for axis in (0, 1):
        step = 1e-2 * np.eye(2)[axis]
        change = model.world(parameters, pixels + step) - model.world(parameters, pixels - step)
        np.testing.assert_allclose(slope[:, :, axis], change / 2e-2, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("number", MODELS)
def test_goes_into_the_file_as_it_is(number: int, pinhole: Any, all_models: list[HomographyModel]) -> None:
    model = all_models[number]
    parameters = parameters_of(model, pinhole)
    written = model.as_map(parameters)
    numbers = list(written.matrix)
    if written.distortion is not None:
        numbers += [written.distortion.k1, written.distortion.k2, written.distortion.p1, written.distortion.p2]
    if written.correction is not None:
        assert written.correction.order == model.correction
        numbers += written.correction.alpha_y + written.correction.alpha_z
    assert numbers == parameters.tolist()


@pytest.mark.parametrize("what", ["points", "lines"])
def test_algebraic_homography_is_exact_on_exact_data(what: str, pinhole: Any) -> None:
    matrix = pinhole(roll_deg=-35.0).to_plane()
    generator = np.random.default_rng(4)
    count = 4 if what == "points" else 9
    pixels = generator.uniform([0, 0], [639, 479], (count, 2))
    world = pinhole(roll_deg=-35.0).world(pixels)
    if what == "points":
        pixels, normals = np.concatenate([pixels, pixels]), np.repeat(np.eye(2), count, axis=0)
        world = np.concatenate([world, world])
    else:
        bearing = generator.uniform(0, np.pi, count)
        normals = np.column_stack([np.cos(bearing), np.sin(bearing)])
    offsets = np.sum(normals * world, axis=1)
    found = algebraic_homography(pixels, normals, offsets)
    np.testing.assert_allclose(found, matrix / matrix[2, 2], rtol=1e-5, atol=1e-7)
    seen = np.column_stack([pixels, np.ones(len(pixels))]) @ found.T
    np.testing.assert_allclose(np.sum(normals * seen[:, :2], axis=1) / seen[:, 2], offsets, atol=1e-6)


def test_algebraic_homography_far_from_the_origin(pinhole: Any) -> None:
    """Without bringing the data to unit size first, ten digits would be lost."""
    pixels = np.random.default_rng(5).uniform([0, 0], [639, 479], (30, 2))
    world = pinhole().world(pixels) + np.array([5000.0, -8000.0])
    normals, offsets = np.repeat(np.eye(2), 30, axis=0), world.T.ravel()
    found = algebraic_homography(np.concatenate([pixels, pixels]), normals, offsets)
    seen = np.column_stack([pixels, np.ones(30)]) @ found.T
    np.testing.assert_allclose(seen[:, :2] / seen[:, 2:], world, atol=1e-5)


def test_the_origin_may_lie_on_the_horizon() -> None:
    """(Y, Z) = (1, v) / u is a homography whose last number is 0: its entries become large, and it is right."""
    pixels = np.random.default_rng(6).uniform([1, 1], [3, 3], (30, 2))
    world = np.column_stack([1 / pixels[:, 0], pixels[:, 1] / pixels[:, 0]])
    normals, offsets = np.repeat(np.eye(2), 30, axis=0), world.T.ravel()
    found = algebraic_homography(np.concatenate([pixels, pixels]), normals, offsets)
    assert np.isfinite(found).all()
    seen = np.column_stack([pixels, np.ones(30)]) @ found.T
    np.testing.assert_allclose(seen[:, :2] / seen[:, 2:], world, rtol=1e-4)


def test_one_place_gives_finite_numbers() -> None:
    place = np.zeros((40, 2))
    found = algebraic_homography(place, np.repeat(np.eye(2), 20, axis=0), np.repeat([3.0, 4.0], 20))
    assert np.isfinite(found).all()


def test_no_pixels(all_models: list[HomographyModel], pinhole: Any) -> None:
    for model in all_models:
        parameters = parameters_of(model, pinhole)
        assert model.world(parameters, np.empty((0, 2))).shape == (0, 2)
        assert model.by_pixels(parameters, np.empty((0, 2))).shape == (0, 2, 2)

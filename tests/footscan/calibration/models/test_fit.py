"""Least squares: the true parameters, honest covariances, outliers without weight, clear refusals."""

import os
import subprocess
import sys
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from footscan.calibration.models.fit import ModelFit, UndeterminedError, fit, predict
from footscan.calibration.models.homography import HomographyModel
from footscan.calibration.models.maps import Model, prediction_covariance
from footscan.calibration.models.observations import Observations, of_points
from footscan.calibration.models.polynomial import PolynomialModel
from schemas.calibration import CameraCalibration

CENTRE, SCALE = (319.5, 239.5), float(np.hypot(319.5, 239.5))
MODELS: list[Model] = [
    PolynomialModel(1, CENTRE, 320.0),
    PolynomialModel(3, CENTRE, 320.0),
    HomographyModel(CENTRE, SCALE),
    HomographyModel(CENTRE, SCALE, True),
]
PROBES = np.array([[100.0, 80.0], [319.5, 239.5], [600.0, 400.0]])


def truth_of(model: Model, pinhole: Any) -> np.ndarray:
    if isinstance(model, PolynomialModel):
        return np.random.default_rng(8).normal(0, 20, model.unknowns)
    parameters = pinhole(roll_deg=15.0).parameters(model)
    parameters[8:12] = [-0.02, 0.003, 0.001, -0.001][: len(parameters) - 8]
    return np.asarray(parameters)


def stripe(world: np.ndarray, pixels: np.ndarray, seed: int, per_block: int = 1) -> Observations:
    """Each pixel on a line through its world point; the pixels of a block on lines of one direction, which is any."""
    count = len(pixels)
    block = np.arange(count) // per_block
    bearing = np.random.default_rng(seed).uniform(0, np.pi, count)[block]
    normals = np.column_stack([np.cos(bearing), np.sin(bearing)])
    return Observations(pixels, normals, np.sum(normals * world, axis=1), np.arange(count), block, block)


def image(count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform([0, 0], [639, 479], (count, 2))


def covariance_at(found: ModelFit, pixels: np.ndarray) -> np.ndarray:
    assert found.covariance is not None
    camera = CameraCalibration(
        camera=1,
        map=found.model.as_map(found.parameters),
        covariance=[row[: k + 1].tolist() for k, row in enumerate(found.covariance)],
        region_px=[],
        points=1,
    )
    covariance = prediction_covariance(camera, pixels)
    assert covariance is not None
    return covariance


@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize("model", MODELS)
def test_exact_data_give_the_true_parameters(model: Model, robust: bool, pinhole: Any) -> None:
    truth, pixels = truth_of(model, pinhole), image(80)
    world = model.world(truth, pixels)
    for observations in (of_points(pixels, world, np.arange(80)), stripe(world, pixels, 2)):
        found = fit(model, observations, robust=robust)
        # What is known of lenses beforehand pulls the distortion, by much less than any noise.
        near = 1e-3 if model.prior_precision().any() else 1e-7
        np.testing.assert_allclose(model.world(found.parameters, PROBES), model.world(truth, PROBES), atol=near)
        np.testing.assert_allclose(found.residuals, 0, atol=near)
        if not model.prior_precision().any():
            np.testing.assert_allclose(found.parameters, truth, rtol=1e-5, atol=1e-7)


def test_least_squares_by_hand() -> None:
    # Y = a + b u with v unseen in it: four pixels at the corners of a square, Y = 0, 0, 1, 3 at u = -1, -1, 1, 1
    pixels = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    world = np.column_stack([[0.0, 0.0, 1.0, 3.0], [5.0, 5.0, 5.0, 5.0]])
    found = fit(PolynomialModel(1, (0.0, 0.0), 1.0), of_points(pixels, world, np.arange(4)), robust=False)
    # mean 1, slope in u (1 + 3 - 0 - 0) / 4 = 1, in v (0 + 3 - 0 - 1) / 4 = 0.5; Y of the fit: -0.5, 0.5, 1.5, 2.5
    np.testing.assert_allclose(found.parameters, [1, 1, 0.5, 5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(found.residuals, [-0.5, 0.5, 0.5, -0.5, 0, 0, 0, 0], atol=1e-12)
    # the columns are orthogonal and of one length
    assert found.condition == pytest.approx(1.0)
    # sum of squares 1 over 8 - 6 degrees of freedom; every coefficient rests on four observations
    assert found.covariance is not None
    np.testing.assert_allclose(found.covariance, 0.5 / 4 * np.eye(6), atol=1e-12)


def test_predict_is_the_distance_from_the_lines(pinhole: Any) -> None:
    model = HomographyModel(CENTRE, SCALE)
    pixels = image(20)
    found = fit(model, of_points(pixels, pinhole().world(pixels), np.arange(20)), robust=False)
    away = pinhole().world(PROBES) + np.array([0.3, -0.4])
    observations = of_points(PROBES, away, np.arange(3))
    np.testing.assert_allclose(predict(found, observations), [-0.3] * 3 + [0.4] * 3, atol=1e-8)
    np.testing.assert_allclose(observations.distances(predict(found, observations)), [0.5] * 3, atol=1e-8)


@dataclass(frozen=True)
class From:
    """A model whose fit begins elsewhere."""

    model: HomographyModel
    begin: np.ndarray

    def __getattr__(self, name: str) -> Any:
        return getattr(self.model, name)

    def start(self, *_: np.ndarray) -> np.ndarray:
        return self.begin


@pytest.mark.parametrize("seed", range(8))
def test_bad_starts_are_overcome(seed: int, pinhole: Any) -> None:
    """A camera that stands 30 degrees and 60 mm away from the true one, with a lens bent the other way."""
    generator = np.random.default_rng(seed)
    model = HomographyModel(CENTRE, SCALE, True)
    truth, pixels = truth_of(model, pinhole), image(100)
    observations = stripe(model.world(truth, pixels), pixels, seed)
    elsewhere = pinhole(
        distance_mm=300 + generator.choice([-60, 60]),
        roll_deg=15 + generator.choice([-30, 30]),
        bearing_deg=45 + generator.choice([-30, 30]),
        angle_deg=42 + generator.choice([-15, 15]),
        target_mm=(-20.0, 70.0),
    ).parameters(model)
    elsewhere[8:12] = [0.05, -0.02, 0.01, 0.01]
    moved: Any = From(model, elsewhere)
    found = fit(moved, observations, robust=False)
    near = fit(model, observations, robust=False)
    np.testing.assert_allclose(
        model.world(found.parameters, PROBES), model.world(near.parameters, PROBES), rtol=0, atol=1e-6
    )
    np.testing.assert_allclose(model.world(found.parameters, PROBES), model.world(truth, PROBES), rtol=0, atol=1e-3)


@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize("kind", ["points", "lines", "blocks"])
def test_covariance_is_the_scatter_of_repeats(kind: str, robust: bool, pinhole: Any) -> None:
    """300 calibrations with noise of 0.1 mm; in blocks, the noise is common to the ten pixels of each."""
    model = HomographyModel(CENTRE, SCALE, True)
    truth, generator = truth_of(model, pinhole), np.random.default_rng(4)
    pixels = image(60)
    if kind == "blocks":
        pixels = (pixels[:, np.newaxis] + np.arange(10)[:, np.newaxis] * [0.1, 0.05]).reshape(-1, 2)
    world = model.world(truth, pixels)
    exact = stripe(world, pixels, 3, per_block=len(pixels) // 60)
    if kind == "points":
        exact = of_points(pixels, world, np.arange(60))
    seen, predicted = [], []
    for _ in range(300):
        noise = generator.normal(0, 0.1, exact.independent)
        repeat = replace(exact, offsets=exact.offsets + noise[exact.block])
        found = fit(model, repeat, robust=robust)
        seen.append(model.world(found.parameters, PROBES))
        predicted.append(covariance_at(found, PROBES))
    scatter = np.std(seen, axis=0)
    expected = np.sqrt(np.diagonal(np.mean(predicted, axis=0), axis1=1, axis2=2))
    np.testing.assert_allclose(scatter / expected, 1.0, atol=0.15)


def test_copies_in_a_block_make_nothing_surer(pinhole: Any) -> None:
    model = HomographyModel(CENTRE, SCALE)
    pixels = image(40)
    noise = np.random.default_rng(5).normal(0, 0.1, (40, 2))
    once = stripe(pinhole().world(pixels) + noise, pixels, 6)
    many = once.part(np.repeat(np.arange(40), 25))
    alone, copied = fit(model, once, robust=False), fit(model, many, robust=False)
    np.testing.assert_allclose(copied.parameters, alone.parameters, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(covariance_at(copied, PROBES), covariance_at(alone, PROBES), rtol=1e-6)
    # as observations of their own, they would
    separate = fit(model, replace(many, block=np.arange(1000)), robust=False)
    assert np.all(covariance_at(separate, PROBES)[:, 0, 0] < covariance_at(alone, PROBES)[:, 0, 0] / 20)


def test_a_large_block_weighs_no_more_than_a_small_one() -> None:
    # Y is 0 at nine pixels of one block and 1 at the one pixel of another, same place: the mean of the blocks is 0.5
    places = np.array([[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]])
    pixels = np.repeat(places, 11, axis=0)
    y = np.tile([0.0] * 9 + [1.0, 0.5], 3)
    observations = of_points(pixels, np.column_stack([y, y]), np.zeros(33, np.intp))
    block = np.arange(33) // 11 * 3 + np.tile([0] * 9 + [1, 2], 3)
    observations = replace(observations, block=np.concatenate([block, 9 + block]))
    found = fit(PolynomialModel(1, (0.0, 0.0), 1.0), observations, robust=False)
    np.testing.assert_allclose(found.parameters, [0.5, 0, 0, 0.5, 0, 0], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("size_mm", [2.0, 20.0])
@pytest.mark.parametrize("model", [MODELS[0], MODELS[2], MODELS[3]])
def test_a_fifth_of_outliers_lose_their_weight(model: Model, size_mm: float, seed: int, pinhole: Any) -> None:
    truth, pixels, generator = truth_of(model, pinhole), image(300, seed), np.random.default_rng(seed)
    clean = stripe(model.world(truth, pixels), pixels, seed)
    offsets = clean.offsets + generator.normal(0, 0.05, 300)
    outliers = generator.permutation(300) < 60
    spoilt = offsets + outliers * generator.uniform(0.2, 1.0, 300) * size_mm
    expected = model.world(truth, PROBES)
    robust = fit(model, replace(clean, offsets=spoilt), robust=True)
    plain = fit(model, replace(clean, offsets=spoilt), robust=False)
    error = np.abs(model.world(robust.parameters, PROBES) - expected).max()
    assert error < 0.05
    assert np.abs(model.world(plain.parameters, PROBES) - expected).max() > 3 * error


def test_robust_fits_of_exact_data_call_nothing_an_outlier(pinhole: Any) -> None:
    model = HomographyModel(CENTRE, SCALE)
    pixels = image(30)
    world = np.round(pinhole().world(pixels), 3)  # a thousandth of a millimetre off
    plain, robust = (fit(model, of_points(pixels, world, np.arange(30)), robust=robust) for robust in (False, True))
    np.testing.assert_allclose(robust.parameters, plain.parameters, rtol=1e-3, atol=1e-4)


def test_a_correction_takes_what_is_left(pinhole: Any) -> None:
    """A smooth bulge of 0.3 mm on the map of a pinhole."""
    pixels = image(500)
    u, v = ((pixels - CENTRE) / SCALE).T
    world = pinhole().world(pixels) + 0.3 * np.column_stack([u * v, u**4 - v * v])
    errors = []
    for model in (HomographyModel(CENTRE, SCALE, True), HomographyModel(CENTRE, SCALE, True, 4)):
        observations = stripe(world, pixels, 9)
        found = fit(model, observations, robust=False)
        errors.append(np.abs(model.world(found.parameters, pixels) - world).max())
    assert errors[0] > 0.05
    assert errors[1] < 0.005


@settings(max_examples=20, deadline=None)
@given(order=st.permutations(range(60)), model=st.sampled_from(MODELS), robust=st.booleans())
def test_observations_in_another_order_give_the_same_fit_to_the_bit(
    order: list[int], model: Model, robust: bool, pinhole: Any
) -> None:
    pixels = image(60)
    noise = np.random.default_rng(10).normal(0, 0.1, (60, 2))
    observations = stripe(model.world(truth_of(model, pinhole), pixels) + noise, pixels, 11, per_block=2)
    first = fit(model, observations.sorted(), robust=robust)
    second = fit(model, observations.part(np.array(order)).sorted(), robust=robust)
    np.testing.assert_array_equal(first.parameters, second.parameters)
    assert first.covariance is not None
    assert second.covariance is not None
    np.testing.assert_array_equal(first.covariance, second.covariance)
    # and without being sorted, to rounding
    third = fit(model, observations.part(np.array(order)), robust=robust)
    np.testing.assert_allclose(model.world(third.parameters, PROBES), model.world(first.parameters, PROBES), atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(scale=st.floats(0.01, 100), model=st.sampled_from(MODELS[:3]))
def test_another_unit_scales_the_map(scale: float, model: Model, pinhole: Any) -> None:
    """Observations times s give a map times s, and s times as unsure, where nothing is known beforehand in mm."""
    pixels = image(60)
    noise = np.random.default_rng(12).normal(0, 0.1, (60, 2))
    observations = stripe(model.world(truth_of(model, pinhole), pixels) + noise, pixels, 13)
    first = fit(model, observations, robust=False)
    second = fit(model, replace(observations, offsets=scale * observations.offsets), robust=False)
    np.testing.assert_allclose(
        model.world(second.parameters, PROBES) / scale, model.world(first.parameters, PROBES), rtol=0, atol=1e-6
    )
    np.testing.assert_allclose(covariance_at(second, PROBES) / scale**2, covariance_at(first, PROBES), rtol=1e-4)


def test_the_number_of_blas_threads_does_not_matter() -> None:
    """Results are the same to the byte: 3,000 observations are enough for BLAS to share out its sums."""
    program = """
import hashlib
import numpy as np
from footscan.calibration.models.fit import fit
from footscan.calibration.models.homography import HomographyModel
from footscan.calibration.models.observations import of_points
generator = np.random.default_rng(1)
pixels = generator.uniform([0, 0], [639, 479], (1500, 2))
world = (pixels - 300) * [0.1, -0.1] + generator.normal(0, 0.1, (1500, 2))
found = fit(HomographyModel((319.5, 239.5), 399.3, True, 3), of_points(pixels, world, np.arange(1500)), robust=True)
print(hashlib.sha256(found.parameters.tobytes() + found.covariance.tobytes()).hexdigest())
"""
    digests = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2", "4")
    }
    assert len(digests) == 1


def test_no_freedom_no_covariance(pinhole: Any) -> None:
    model = HomographyModel(CENTRE, SCALE)
    pixels = np.array([[50, 40], [600, 60], [580, 430], [70, 420.0]])
    found = fit(model, of_points(pixels, pinhole().world(pixels), np.arange(4)), robust=False)
    assert found.covariance is None
    np.testing.assert_allclose(model.world(found.parameters, PROBES), pinhole().world(PROBES), atol=1e-7)


@pytest.mark.parametrize("model", MODELS)
def test_more_unknowns_than_observations_are_refused(model: Model, pinhole: Any) -> None:
    pixels = image(model.unknowns - 1)
    observations = stripe(pinhole().world(pixels), pixels, 1)
    with pytest.raises(UndeterminedError, match=f"{model.unknowns - 1} observations for {model.unknowns} unknowns"):
        fit(model, observations, robust=False)
    # pixels of one block are no more than one observation
    crowded = stripe(*(np.repeat(part, 9, axis=0) for part in (pinhole().world(pixels), pixels)), 1, per_block=9)
    with pytest.raises(UndeterminedError, match=f"{model.unknowns - 1} observations"):
        fit(model, crowded, robust=False)


LINE = np.column_stack([np.linspace(0, 600, 40), np.linspace(10, 400, 40)])
TWO_COLUMNS = np.array([[i, j] for i in (100.0, 500.0) for j in np.linspace(0, 400, 20)])
ONE_PLACE = np.tile([[300.0, 200.0]], (40, 1))


@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize(
    ("model", "pixels"),
    [
        *((model, LINE) for model in MODELS),
        *((model, ONE_PLACE) for model in MODELS),
        (MODELS[1], TWO_COLUMNS),
    ],
)
def test_pixels_that_do_not_tell_the_unknowns_apart_are_refused(
    model: Model, pixels: np.ndarray, robust: bool, pinhole: Any
) -> None:
    world = pinhole().world(pixels)
    for observations in (of_points(pixels, world, np.arange(40)), stripe(world, pixels, 1)):
        with pytest.raises(UndeterminedError):
            fit(model, observations, robust=robust)


@pytest.mark.parametrize("model", MODELS)
def test_lines_of_one_direction_are_refused(model: Model, pinhole: Any) -> None:
    """Edges that run along Z tell nothing of Z."""
    pixels = image(60)
    upright = replace(stripe(pinhole().world(pixels), pixels, 1), normals=np.tile([1.0, 0.0], (60, 1)))
    upright = replace(upright, offsets=pinhole().world(pixels)[:, 0])
    with pytest.raises(UndeterminedError):
        fit(model, upright, robust=False)


def test_all_points_at_one_place_of_the_world_are_refused() -> None:
    pixels = image(30)
    with pytest.raises(UndeterminedError):
        fit(MODELS[2], of_points(pixels, np.tile([3.0, 4.0], (30, 1)), np.arange(30)), robust=False)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(*[st.floats(-1e6, 1e6) | st.sampled_from([0.0, 1.0, 640.0])] * 4), min_size=4, max_size=20),
    st.sampled_from(MODELS),
    st.booleans(),
)
def test_nonsense_ends_in_a_fit_or_a_refusal(rows: list[tuple[float, ...]], model: Model, robust: bool) -> None:
    values = np.array(rows)
    try:
        found = fit(model, of_points(values[:, :2], values[:, 2:], np.arange(len(rows))), robust=robust)
    except UndeterminedError:
        return
    assert np.isfinite(found.parameters).all()
    assert np.isfinite(found.residuals).all()

"""The choice among models: the true one on synthetic truths, honest held-out errors, clear refusals."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from footscan.calibration.models.fit import ModelFit, fit, predict
from footscan.calibration.models.homography import HomographyModel
from footscan.calibration.models.observations import Observations, of_points
from footscan.calibration.models.polynomial import PolynomialModel
from footscan.calibration.models.selection import ModelTrial, candidates, held_out_residuals, rms, select, try_model

IMAGE_PX = (640, 480)
CENTRE, SCALE = (319.5, 239.5), float(np.hypot(319.5, 239.5))
NAMES = [
    *(f"polynomial {order}" for order in (1, 2, 3, 4, 5)),
    "homography",
    "homography, distortion",
    *(f"homography, distortion, correction {order}" for order in (2, 3, 4)),
]


def image(count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform([0, 0], [639, 479], (count, 2))


def clicked(world: np.ndarray, pixels: np.ndarray, noise_mm: float, seed: int = 2) -> Observations:
    noise = np.random.default_rng(seed).normal(0, noise_mm, world.shape)
    return of_points(pixels, world + noise, np.arange(len(world)))


def fares(observations: Observations, *, robust: bool = False) -> tuple[ModelFit | None, Mapping[str, ModelTrial]]:
    found, trials = select(candidates(observations.pixels, IMAGE_PX), observations, 3, robust=robust)
    assert [trial.model for trial in trials] == NAMES
    return found, {trial.model: trial for trial in trials}


def chosen_of(trials: Mapping[str, ModelTrial]) -> str:
    [chosen] = [trial.model for trial in trials.values() if trial.status == "chosen"]
    return chosen


def test_candidates_are_normalised() -> None:
    tried = candidates(np.array([[100.0, 50.0], [500.0, 150.0], [300.0, 100.0]]), IMAGE_PX)
    assert [candidate.name for candidate in tried] == NAMES
    assert [candidate.unknowns for candidate in tried] == [6, 12, 20, 30, 42, 8, 12, 18, 26, 36]
    # polynomials to the pixels: i from 100 to 500; homographies to the image
    assert tried[0] == PolynomialModel(1, (300.0, 100.0), 200.0)
    assert tried[5] == HomographyModel(CENTRE, SCALE)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_the_true_order_is_chosen(order: int) -> None:
    pixels = image(80)
    model = PolynomialModel(order, (320.0, 240.0), 320.0)
    truth = np.random.default_rng(order).normal(0, 20, model.unknowns)
    found, trials = fares(clicked(model.world(truth, pixels), pixels, 0.05))
    assert chosen_of(trials) == f"polynomial {order}"
    assert found is not None
    assert found.model.unknowns == model.unknowns


@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize("count", [5, 7, 40, 200])
def test_a_pinhole_is_a_homography(count: int, robust: bool, pinhole: Any) -> None:
    pixels = image(count)
    found, trials = fares(clicked(pinhole().world(pixels), pixels, 0.05), robust=robust)
    assert chosen_of(trials) == "homography"
    assert found is not None
    np.testing.assert_allclose(found.model.world(found.parameters, pixels), pinhole().world(pixels), atol=0.2)


def test_few_points_give_a_homography_more_often_than_not(pinhole: Any) -> None:
    """Twelve points hardly tell a lens from none; the map with one is hardly worse then."""
    chosen = []
    for seed in range(10):
        pixels = image(12, seed)
        world = pinhole().world(pixels)
        found, trials = fares(clicked(world, pixels, 0.05, seed))
        chosen.append(chosen_of(trials))
        assert found is not None
        assert rms(np.hypot(*(found.model.world(found.parameters, pixels) - world).T)) < 2 * 0.05 * np.sqrt(2)
    assert set(chosen) <= {"homography", "homography, distortion"}
    assert chosen.count("homography") > 5


def test_a_lens_is_seen(pinhole: Any) -> None:
    model = HomographyModel(CENTRE, SCALE, True)
    truth = pinhole().parameters(model)
    truth[8] = -0.024
    pixels = image(150)
    found, trials = fares(clicked(model.world(truth, pixels), pixels, 0.02))
    assert chosen_of(trials) == "homography, distortion"
    assert found is not None
    assert found.parameters[8] == pytest.approx(-0.024, abs=0.002)


def test_what_a_lens_cannot_do_is_corrected(pinhole: Any) -> None:
    pixels = image(300)
    u, v = ((pixels - CENTRE) / SCALE).T
    bulge = 0.8 * np.column_stack([u * v + u * u, u * v - v * v])
    world = pinhole().world(pixels) + bulge
    found, trials = fares(clicked(world, pixels, 0.01))
    assert chosen_of(trials).startswith("homography, distortion, correction")
    assert found is not None
    assert np.abs(found.model.world(found.parameters, pixels) - world).max() < 0.02
    plain = trials["homography, distortion"].held_out_rms_mm
    assert plain is not None
    assert plain > 3 * 0.01 * np.sqrt(2)


@pytest.mark.parametrize("seed", range(3))
def test_glints_do_not_hide_a_lens(seed: int, pinhole: Any) -> None:
    """A lens that adds 0.03 mm or so, among points of which one in thirty lies half a millimetre off."""
    model = HomographyModel(CENTRE, SCALE, True)
    truth = pinhole().parameters(model)
    truth[8] = -0.003
    pixels = image(900, seed)
    world = model.world(truth, pixels)
    world[::30] += [0.35, -0.35]
    observations = clicked(world, pixels, 0.02, seed)
    tried = [candidate for candidate in candidates(pixels, IMAGE_PX) if candidate.kind.startswith("homography")][:2]
    _, trials = select(tried, observations, 1, robust=True)
    assert [trial.status for trial in trials] == ["tried", "chosen"]


def test_held_out_error_of_clicks_is_about_their_noise(pinhole: Any) -> None:
    pixels = image(400)
    _, trials = fares(clicked(pinhole().world(pixels), pixels, 0.1))
    trial = trials["homography"]
    assert trial.held_out_rms_mm == pytest.approx(0.1 * np.sqrt(2), rel=0.1)  # of Y and of Z
    assert trial.rms_mm is not None
    assert trial.rms_mm < trial.held_out_rms_mm


def test_own_error_falls_with_the_order_and_held_out_error_does_not() -> None:
    pixels = image(30)
    world = np.column_stack([0.1 * pixels[:, 0] - 30, 90 - 0.2 * pixels[:, 1]])
    _, trials = fares(clicked(world, pixels, 0.3))
    own, held_out = [], []
    for order in (1, 2, 3, 4):
        trial = trials[f"polynomial {order}"]
        assert trial.rms_mm is not None
        assert trial.held_out_rms_mm is not None
        own.append(trial.rms_mm)
        held_out.append(trial.held_out_rms_mm)
    assert own == sorted(own, reverse=True)
    assert held_out[3] > 1.2 * held_out[0]


def test_held_out_residuals_are_those_of_fits_without_the_group(pinhole: Any) -> None:
    pixels = image(9)
    observations = clicked(pinhole().world(pixels), pixels, 0.1)
    model = HomographyModel(CENTRE, SCALE)
    found = fit(model, observations, robust=False)
    residuals = held_out_residuals(found, observations, robust=False)
    assert residuals is not None
    for n in range(9):
        own = observations.point == n
        rest = fit(model, observations.part(~own), robust=False)
        np.testing.assert_allclose(residuals[own], predict(rest, observations.part(own)), rtol=1e-9)
    # points 0 and 1 in one group are left out together
    together = replace(observations, group=np.where(observations.group == 1, 0, observations.group))
    residuals = held_out_residuals(found, together, robust=False)
    assert residuals is not None
    first = observations.point <= 1
    rest = fit(model, observations.part(~first), robust=False)
    np.testing.assert_allclose(residuals[first], predict(rest, observations.part(first)), rtol=1e-9)


def test_many_groups_are_ten_folds(pinhole: Any) -> None:
    pixels = image(35)
    observations = clicked(pinhole().world(pixels), pixels, 0.1)
    found = fit(HomographyModel(CENTRE, SCALE), observations, robust=False)
    residuals = held_out_residuals(found, observations, robust=False)
    assert residuals is not None
    third = observations.group % 10 == 3
    rest = fit(found.model, observations.part(~third), robust=False)
    np.testing.assert_allclose(residuals[third], predict(rest, observations.part(third)), rtol=1e-9)


def test_nothing_can_be_held_out_of_one_group(pinhole: Any) -> None:
    pixels = image(20)
    observations = clicked(pinhole().world(pixels), pixels, 0.1)
    one_group = replace(observations, group=np.zeros(40, np.intp))
    found, trials = fares(one_group)
    assert found is None
    assert {trial.held_out_rms_mm for trial in trials.values()} == {None}
    assert trials["homography"].rms_mm is not None


def test_the_worst_point_is_named(pinhole: Any) -> None:
    pixels = image(40)
    world = pinhole().world(pixels)
    world[17] += [3.0, -4.0]
    _, trials = fares(clicked(world, pixels, 0.02))
    assert trials["homography"].worst_point == 17
    assert trials["homography"].worst_mm == pytest.approx(5.0, abs=1.0)


def test_models_with_more_unknowns_than_data_are_refused(pinhole: Any) -> None:
    pixels = image(6)
    found, trials = fares(clicked(pinhole().world(pixels), pixels, 0.02))
    assert {name: (trial.status, trial.remark) for name, trial in trials.items()} == {
        "polynomial 1": ("tried", ""),
        "polynomial 2": ("determined", "passes through its points by construction"),
        "polynomial 3": ("refused", "12 observations for 20 unknowns"),
        "polynomial 4": ("refused", "12 observations for 30 unknowns"),
        "polynomial 5": ("refused", "12 observations for 42 unknowns"),
        "homography": ("chosen", ""),
        "homography, distortion": ("determined", "passes through its points by construction"),
        "homography, distortion, correction 2": ("refused", "12 observations for 18 unknowns"),
        "homography, distortion, correction 3": ("refused", "12 observations for 26 unknowns"),
        "homography, distortion, correction 4": ("refused", "12 observations for 36 unknowns"),
    }
    assert found is not None
    refused = trials["polynomial 3"]
    assert (refused.unknowns, refused.observations, refused.points) == (20, 12, 6)
    assert (refused.rms_mm, refused.held_out_rms_mm, refused.worst_mm, refused.condition) == (None,) * 4
    # what passes through its points says nothing of itself, so it is not held out either
    assert trials["polynomial 2"].held_out_rms_mm is None


def test_of_equals_the_one_with_fewer_unknowns_is_taken() -> None:
    """An affine map without noise but that of rounding to 0.01 mm: a homography and higher orders hold it as well."""
    pixels = image(400)
    world = np.round(np.column_stack([0.1 * pixels[:, 0] - 30, 90 - 0.2 * pixels[:, 1]]), 2)
    _, trials = fares(of_points(pixels, world, np.arange(400)))
    assert chosen_of(trials) == "polynomial 1"
    equal = [trial.held_out_rms_mm or np.inf for trial in trials.values() if trial.unknowns <= 12]
    assert max(equal) < 1.02 * min(equal)


def test_a_trial_does_not_depend_on_the_order(pinhole: Any) -> None:
    pixels = image(30)
    observations = clicked(pinhole().world(pixels), pixels, 0.1)
    shuffled = observations.part(np.random.default_rng(3).permutation(60))
    for candidate in candidates(pixels, IMAGE_PX)[:8]:
        first, first_trial = try_model(candidate, observations, 1, robust=False)
        second, second_trial = try_model(candidate, shuffled, 1, robust=False)
        assert second_trial == first_trial
        if first is not None:
            assert second is not None
            np.testing.assert_array_equal(second.parameters, first.parameters)


def test_rms() -> None:
    assert rms(np.array([1.0, 7.0])) == 5.0


def test_a_model_without_a_lens_is_no_surer_between_the_data_than_one_with_a_lens(pinhole: Any) -> None:
    """Two edges near one side of the image say nothing of the lens at the other side."""
    pixels = np.random.default_rng(4).uniform((300, 200), (380, 260), (60, 2))
    pixels = np.concatenate([pixels, [[20.0, 240.0]]])
    _, trials = fares(clicked(pinhole().world(pixels), pixels, 0.02))
    plain, with_a_lens = (trials[name].region_sigma_mm for name in ("homography", "homography, distortion"))
    assert plain is not None
    assert with_a_lens is not None
    assert plain >= with_a_lens

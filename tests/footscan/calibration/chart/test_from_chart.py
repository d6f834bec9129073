"""Calibration from charts of control points: the right model, honest errors, clear refusals."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from footscan.calibration.chart.chart import Chart
from footscan.calibration.chart.from_chart import calibrate_chart, compare_models, observe
from footscan.calibration.chart.quadratic import fit_quadratic
from footscan.calibration.models.maps import is_supported, prediction_covariance, to_world
from footscan.calibration.models.selection import ModelTrial
from footscan.thesis.printed import printed_charts
from schemas.base.errors import RefusedInput
from schemas.calibration import Calibration, CameraCalibration, HomographyMap, PolynomialMap, Source
from schemas.parameters.calibration import CalibrationParameters

DATA = Path(__file__).parent / "data"
SOURCE = Source(name="chart.csv", sha256="00")
PROBES = np.array([[200.0, 150.0], [320.0, 240.0], [450.0, 330.0]])
MODELS = ["auto", "polynomial", "homography", "homography-distortion", "quadratic"]


def calibrate(*charts: Chart, **parameters: object) -> tuple[Calibration, list[ModelTrial]]:
    return calibrate_chart(
        {chart.camera: chart for chart in charts},
        parameters=CalibrationParameters.model_validate(parameters),
        source=SOURCE,
        software="test",
    )


def camera_of(*charts: Chart, **parameters: object) -> CameraCalibration:
    return calibrate(*charts, **parameters)[0].camera(1)


def third_order_chart(noise_px: float = 0.0, points: int = 60) -> Chart:
    """Points whose Y and Z follow polynomials of order three of (i - 320) / 320 and (j - 240) / 320."""
    generator = np.random.default_rng(5)
    pixels = np.stack([generator.uniform(0, 640, points), generator.uniform(0, 480, points)], axis=1)
    u, v = (pixels[:, 0] - 320) / 320, (pixels[:, 1] - 240) / 320
    world = np.stack([0 * u, 60 * u + 5 * u * v + 3 * u**3, 50 - 70 * v + 4 * u * u - 2 * v**3], axis=1)
    clicked = pixels + generator.uniform(-noise_px, noise_px, pixels.shape)
    return Chart(1, tuple(f"P{n}" for n in range(points)), world, "mm", clicked)


def pinhole_chart(pinhole: Any, points: int = 30, noise_px: float = 0.3) -> Chart:
    generator = np.random.default_rng(6)
    pixels = generator.uniform([10, 10], [630, 470], (points, 2))
    world = np.column_stack([np.zeros(points), pinhole().world(pixels)])
    clicked = pixels + generator.normal(0, noise_px, pixels.shape)
    return Chart(1, tuple(f"P{n}" for n in range(points)), world, "mm", clicked)


def rearranged(chart: Chart, order: np.ndarray) -> Chart:
    points = tuple(chart.points[n] for n in order)
    return Chart(chart.camera, points, chart.world[order], chart.unit, chart.pixels[order])


def test_a_pinhole_gets_a_homography(pinhole: Any) -> None:
    calibration, trials = calibrate(pinhole_chart(pinhole))
    camera = calibration.camera(1)
    assert [trial.model for trial in trials if trial.status == "chosen"] == ["homography"]
    assert isinstance(camera.map, HomographyMap)
    assert (camera.image_px, camera.points) == ((640, 480), 30)
    errors = to_world(camera, PROBES) - pinhole().world(PROBES)
    # clicks to 0.3 px are 0.1 mm or so; of 30, an eighth remains
    assert np.abs(errors).max() < 0.1
    covariance = prediction_covariance(camera, PROBES)
    assert covariance is not None
    assert np.all(np.abs(errors) < 4 * np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)))


def test_says_what_it_was_made_from(pinhole: Any) -> None:
    calibration, _ = calibrate(pinhole_chart(pinhole))
    assert (calibration.sources, calibration.software, calibration.created) == ([SOURCE], "test", None)
    assert Calibration.model_validate_json(calibration.model_dump_json()) == calibration


def test_five_points_of_a_pinhole_are_enough_for_a_homography(pinhole: Any) -> None:
    """Five clicks, as the thesis has them: its quadratic interpolates, a homography has data to spare."""
    generator = np.random.default_rng(7)
    pixels = np.array([[80, 60], [560, 70], [540, 420], [100, 400], [330, 250.0]])
    world = np.column_stack([np.zeros(5), pinhole().world(pixels)])
    chart = Chart(1, tuple("ABCDE"), world, "mm", pixels + generator.normal(0, 0.3, (5, 2)))
    homography, quadratic = camera_of(chart, model="homography"), camera_of(chart, model="quadratic")
    errors = [np.abs(to_world(camera, PROBES) - pinhole().world(PROBES)).max() for camera in (homography, quadratic)]
    assert errors[0] < 0.3
    assert errors[1] > 1.0
    assert homography.held_out_rms_mm is not None
    assert quadratic.held_out_rms_mm is None


def test_finds_a_polynomial_of_order_three() -> None:
    chart = third_order_chart()
    calibration, trials = calibrate(chart, model="polynomial")
    camera = calibration.camera(1)
    assert isinstance(camera.map, PolynomialMap)
    assert camera.map.order >= 3  # higher ones hold it too, to rounding
    exact = [trial.held_out_rms_mm is not None and trial.held_out_rms_mm < 1e-9 for trial in trials]
    assert exact == [False, False, True, True, True]
    # at the centre of the image: Y = 0, Z = 50
    np.testing.assert_allclose(to_world(camera, np.array([[320.0, 240.0]])), [[0, 50]], atol=1e-9)


def test_clicks_to_half_a_pixel_choose_the_true_order() -> None:
    _, trials = calibrate(third_order_chart(noise_px=0.5), model="polynomial")
    assert [trial.status for trial in trials] == ["tried", "tried", "chosen", "tried", "tried"]
    assert [trial.unknowns for trial in trials] == [6, 12, 20, 30, 42]
    assert {(trial.points, trial.observations) for trial in trials} == {(60, 120)}
    own = [trial.rms_mm for trial in trials if trial.rms_mm is not None]
    assert own == sorted(own, reverse=True)


def test_an_order_that_is_asked_for_is_taken() -> None:
    calibration, trials = calibrate(third_order_chart(noise_px=0.5), model="polynomial", order=2)
    assert [(trial.model, trial.status) for trial in trials] == [("polynomial 2", "chosen")]
    assert isinstance(pixel_map := calibration.camera(1).map, PolynomialMap)
    assert pixel_map.order == 2


def test_a_corner_clicked_twice_does_not_vouch_for_itself(pinhole: Any) -> None:
    chart = pinhole_chart(pinhole, 10)
    twice = rearranged(chart, np.repeat(np.arange(10), 2))
    once, doubled = camera_of(chart, model="homography"), camera_of(twice, model="homography")
    np.testing.assert_allclose(to_world(doubled, PROBES), to_world(once, PROBES), atol=1e-9)
    assert doubled.held_out_rms_mm == pytest.approx(once.held_out_rms_mm, rel=1e-6)
    groups = observe(twice).group[:20]
    assert groups[::2].tolist() == groups[1::2].tolist()
    assert len(np.unique(groups)) == 10


def test_a_mistyped_click_is_named(pinhole: Any) -> None:
    chart = pinhole_chart(pinhole)
    chart.pixels[17, 0] += 40
    trial = next(trial for trial in compare_models(chart) if trial.model == "homography")
    assert trial.worst_point == 17
    assert chart.points[trial.worst_point] == "P17"


@settings(max_examples=15, deadline=None)
@given(order=st.permutations(range(20)), model=st.sampled_from(MODELS[:-1]))
def test_rows_in_another_order_give_the_same_calibration_to_the_bit(order: list[int], model: str, pinhole: Any) -> None:
    chart = pinhole_chart(pinhole, 20)
    first, trials = calibrate(chart, model=model)
    second, other = calibrate(rearranged(chart, np.array(order)), model=model)
    assert second.model_dump_json() == first.model_dump_json()
    names = [chart.points[trial.worst_point] for trial in trials if trial.worst_point is not None]
    assert names == [chart.points[order[trial.worst_point]] for trial in other if trial.worst_point is not None]


@settings(max_examples=15, deadline=None)
@given(order=st.permutations(range(20)))
def test_rows_in_another_order_give_the_same_quadratic(order: list[int], pinhole: Any) -> None:
    """To 1e-9 mm: the plain pixel coordinates leave more to rounding."""
    chart = pinhole_chart(pinhole, 20)
    first = camera_of(chart, model="quadratic")
    second = camera_of(rearranged(chart, np.array(order)), model="quadratic")
    np.testing.assert_allclose(to_world(second, PROBES), to_world(first, PROBES), rtol=0, atol=1e-9)


@pytest.mark.parametrize("model", MODELS)
def test_centimetres_become_millimetres(model: str, pinhole: Any) -> None:
    in_mm = pinhole_chart(pinhole)
    in_cm = Chart(1, in_mm.points, in_mm.world / 10, "cm", in_mm.pixels)
    first, second = camera_of(in_mm, model=model), camera_of(in_cm, model=model)
    np.testing.assert_allclose(to_world(second, PROBES), to_world(first, PROBES), rtol=0, atol=1e-7)
    for name in ("rms_mm", "held_out_rms_mm", "worst_mm"):
        assert getattr(second, name) == pytest.approx(getattr(first, name), rel=1e-6)
    assert second.region_px == first.region_px


def test_region_is_the_hull_of_the_clicks() -> None:
    pixels = np.array([[0, 0], [100, 0], [100, 50], [0, 50], [40, 20], [60, 30.0]])
    chart = Chart(1, tuple("ABCDEF"), np.c_[0 * pixels[:, 0], pixels], "mm", pixels)
    camera = camera_of(chart, model="polynomial", order=1)
    assert camera.region_px == [(0, 0), (100, 0), (100, 50), (0, 50)]
    assert is_supported(camera, pixels).all()
    assert not is_supported(camera, np.array([[101.0, 20.0]])).any()


def test_models_with_more_unknowns_than_data_are_refused() -> None:
    chart = third_order_chart(points=10)
    _, trials = calibrate(chart)
    fared = {trial.model: (trial.status, trial.remark) for trial in trials}
    assert fared["polynomial 3"] == ("determined", "passes through its points by construction")
    assert fared["polynomial 4"] == ("refused", "20 observations for 30 unknowns")
    assert fared["homography, distortion, correction 3"] == ("refused", "20 observations for 26 unknowns")
    with pytest.raises(RefusedInput, match=r"^chart.csv: camera 1: .*20 observations for 30 unknowns"):
        calibrate(chart, model="polynomial", order=4)


def test_points_that_do_not_tell_the_terms_apart_are_refused() -> None:
    # Two columns of points: i takes two values, so i^2 is no other than 1 and i.
    pixels = np.array([[i, j] for i in (100.0, 500.0) for j in (0.0, 100.0, 200.0, 300.0, 400.0)])
    chart = Chart(1, tuple("ABCDEFGHIJ"), np.c_[0 * pixels[:, 0], pixels], "mm", pixels)
    calibration, trials = calibrate(chart, model="polynomial")
    assert isinstance(pixel_map := calibration.camera(1).map, PolynomialMap)
    assert pixel_map.order == 1
    assert [trial.status for trial in trials][1:] == ["refused"] * 4


def test_too_few_points_or_a_line_are_refused() -> None:
    with pytest.raises(RefusedInput, match="camera 1: 3 control points, expected at least 4"):
        calibrate(third_order_chart(points=3))
    line = np.array([[n, 2.0 * n] for n in range(5)])
    with pytest.raises(RefusedInput, match="camera 1: the pixels of all control points lie on one line"):
        calibrate(Chart(1, tuple("ABCDE"), np.c_[line[:, 0], line], "mm", line))
    almost = line + np.random.default_rng(1).normal(0, 1e-7, line.shape)
    with pytest.raises(RefusedInput, match="camera 1: the pixels of all control points lie on one line"):
        calibrate(Chart(1, tuple("ABCDE"), np.c_[line[:, 0], line], "mm", almost), model="quadratic")


def test_thesis_chart_as_the_thesis_has_it() -> None:
    charts = printed_charts()
    calibration, trials = calibrate(*charts.values(), model="quadratic")
    assert [camera.camera for camera in calibration.cameras] == [1, 2, 3, 4, 5, 6, 7, 8]
    assert all(trial.status == "chosen" and "says nothing" in trial.remark for trial in trials)
    for camera_id, chart in charts.items():
        camera = calibration.camera(camera_id)
        pixel_map = camera.map
        assert isinstance(pixel_map, PolynomialMap)
        assert (pixel_map.centre_px, pixel_map.scale_px, camera.held_out_rms_mm) == ((0, 0), 1, None)
        np.testing.assert_allclose(pixel_map.alpha_y, 10 * np.array(fit_quadratic(chart).alpha_y), rtol=1e-14)
        np.testing.assert_allclose(to_world(camera, chart.pixels), 10 * chart.world[:, 1:], atol=1e-6)
        assert camera.covariance == []


def test_thesis_chart_by_models() -> None:
    """Each camera gets one of the models that five points can judge; the second order is not among them."""
    for chart in printed_charts().values():
        trials = {trial.model: trial for trial in compare_models(chart)}
        assert trials["polynomial 2"].status == "refused"
        assert trials["polynomial 2"].remark == "10 observations for 12 unknowns"
        assert trials["homography"].held_out_rms_mm is not None
        assert [trial.status for trial in trials.values()].count("chosen") == 1
        assert {trials["homography"].status, trials["polynomial 1"].status} == {"chosen", "tried"}


def test_quadratic_model_with_many_points_is_order_two() -> None:
    chart = third_order_chart(noise_px=0.5)
    plain, normalised = camera_of(chart, model="quadratic"), camera_of(chart, model="polynomial", order=2)
    np.testing.assert_allclose(to_world(plain, chart.pixels), to_world(normalised, chart.pixels), atol=1e-8)
    assert plain.held_out_rms_mm == normalised.held_out_rms_mm
    assert plain.rms_mm == pytest.approx(normalised.rms_mm)


@pytest.mark.parametrize("model", ["auto", "quadratic", "homography"])
def test_parameters_that_contradict_each_other(model: str) -> None:
    with pytest.raises(ValueError, match="order belongs to the model polynomial"):
        CalibrationParameters.model_validate({"model": model, "order": 3})

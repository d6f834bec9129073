"""Calibration from charts of many points: the right order, honest errors, clear refusals."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from footscan.calibration.chart import Chart, read_chart
from footscan.calibration.fit import OrderTrial, calibrate_chart
from footscan.calibration.polynomial import evaluate, supported
from footscan.calibration.quadratic import fit_quadratic
from schemas.calibration import Calibration, PolynomialCamera
from schemas.errors import RefusedInput
from schemas.parameters.calibration import ChartCalibrationParameters

DATA = Path(__file__).parent / "data"


def calibrate(*charts: Chart, **parameters: object) -> tuple[Calibration, list[OrderTrial]]:
    return calibrate_chart(
        {chart.camera: chart for chart in charts},
        parameters=ChartCalibrationParameters.model_validate(parameters),
        source="chart.csv",
        source_sha256="00",
        software="test",
    )


def third_order_chart(noise_px: float = 0.0, points: int = 60) -> Chart:
    """Points whose Y and Z follow polynomials of order three of (i - 320) / 320 and (j - 240) / 320."""
    generator = np.random.default_rng(5)
    pixels = np.stack([generator.uniform(0, 640, points), generator.uniform(0, 480, points)], axis=1)
    u, v = (pixels[:, 0] - 320) / 320, (pixels[:, 1] - 240) / 320
    world = np.stack([0 * u, 60 * u + 5 * u * v + 3 * u**3, 50 - 70 * v + 4 * u * u - 2 * v**3], axis=1)
    clicked = pixels + generator.uniform(-noise_px, noise_px, pixels.shape)
    return Chart(1, tuple(f"P{n}" for n in range(points)), world, "mm", clicked)


def rearranged(chart: Chart, order: np.ndarray) -> Chart:
    points = tuple(chart.points[n] for n in order)
    return Chart(chart.camera, points, chart.world[order], chart.unit, chart.pixels[order])


def model_of(*charts: Chart, **parameters: object) -> PolynomialCamera:
    return calibrate(*charts, **parameters)[0].camera(1)


def test_finds_the_order_and_the_map() -> None:
    chart = third_order_chart()
    calibration, trials = calibrate(chart)
    model = calibration.camera(1)
    assert model.order >= 3  # higher ones hold it too, to rounding
    assert [trial.held_out_rms_mm is not None and trial.held_out_rms_mm < 1e-9 for trial in trials] == [
        False,
        False,
        True,
        True,
        True,
    ]
    np.testing.assert_allclose(evaluate(model, chart.pixels), chart.world[:, 1:], atol=1e-9)
    # at the centre of the image: Y = 0, Z = 50
    np.testing.assert_allclose(evaluate(model, np.array([[320.0, 240.0]])), [[0, 50]], atol=1e-9)


def test_clicks_to_half_a_pixel_choose_the_true_order() -> None:
    _, trials = calibrate(third_order_chart(noise_px=0.5))
    assert [trial.status for trial in trials] == ["tried", "tried", "chosen", "tried", "tried"]
    assert [trial.unknowns for trial in trials] == [3, 6, 10, 15, 21]
    own = [trial.rms_mm for trial in trials if trial.rms_mm is not None]
    assert own == sorted(own, reverse=True)


def test_held_out_error_is_that_of_fits_without_the_point() -> None:
    chart = third_order_chart(noise_px=0.5, points=25)
    distances = []
    for n in range(25):
        rest = np.array([m for m in range(25) if m != n])
        model = model_of(rearranged(chart, rest), order=3)
        distances.append(np.hypot(*(evaluate(model, chart.pixels[[n]]) - chart.world[n, 1:])[0]))
    _, trials = calibrate(chart, order=3)
    assert trials[2].held_out_rms_mm == pytest.approx(np.sqrt(np.mean(np.square(distances))), rel=1e-9)
    assert trials[2].worst_mm == pytest.approx(max(distances), rel=1e-9)
    assert trials[2].worst_point == chart.points[int(np.argmax(distances))]


def test_a_corner_clicked_twice_does_not_vouch_for_itself() -> None:
    chart = third_order_chart(noise_px=0.5, points=25)
    twice = rearranged(chart, np.repeat(np.arange(25), 2))
    once, doubled = model_of(chart, order=3), model_of(twice, order=3)
    np.testing.assert_allclose(doubled.alpha_y, once.alpha_y, rtol=1e-9, atol=1e-9)
    assert doubled.held_out_rms_mm == pytest.approx(once.held_out_rms_mm, rel=1e-9)


def test_a_mistyped_click_is_named() -> None:
    chart = third_order_chart(noise_px=0.2)
    chart.pixels[17, 0] += 40
    _, trials = calibrate(chart)
    chosen = next(trial for trial in trials if trial.status == "chosen")
    assert chosen.worst_point == "P17"


@settings(max_examples=25, deadline=None)
@given(st.permutations(range(30)))
def test_rows_in_another_order_give_the_same_fit(order: list[int]) -> None:
    chart = third_order_chart(noise_px=0.5, points=30)
    first, second = model_of(chart), model_of(rearranged(chart, np.array(order)))
    assert first.order == second.order
    np.testing.assert_allclose(first.alpha_y, second.alpha_y, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(first.alpha_z, second.alpha_z, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("model", ["polynomial", "quadratic"])
def test_centimetres_become_millimetres(model: str) -> None:
    in_mm = third_order_chart(noise_px=0.5)
    in_cm = Chart(1, in_mm.points, in_mm.world / 10, "cm", in_mm.pixels)
    first, second = model_of(in_mm, model=model), model_of(in_cm, model=model)
    np.testing.assert_allclose(first.alpha_y, second.alpha_y, rtol=1e-9)
    assert first.held_out_rms_mm == pytest.approx(second.held_out_rms_mm)


def test_region_is_the_hull_of_the_clicks() -> None:
    pixels = np.array([[0, 0], [100, 0], [100, 50], [0, 50], [40, 20], [60, 30.0]])
    chart = Chart(1, tuple("ABCDEF"), np.c_[0 * pixels[:, 0], pixels], "mm", pixels)
    model = model_of(chart, order=1)
    assert sorted(model.region_px) == [(0, 0), (0, 50), (100, 0), (100, 50)]
    assert supported(model, pixels).all()
    assert not supported(model, np.array([[101.0, 20.0]])).any()


def test_orders_with_more_unknowns_than_points_are_refused() -> None:
    chart = third_order_chart(points=10)
    _, trials = calibrate(chart)
    assert [trial.status for trial in trials][2:] == ["determined", "refused", "refused"]
    assert trials[2].held_out_rms_mm is None
    assert trials[3].remark == "10 points for 15 unknowns"
    with pytest.raises(RefusedInput, match=r"chart.csv: camera 1: order 4 cannot be fitted: 10 points for 15 unknowns"):
        calibrate(chart, order=4)


def test_points_that_do_not_tell_the_terms_apart_are_refused() -> None:
    # Two columns of points: i takes two values, so i^2 is no other than 1 and i.
    pixels = np.array([[i, j] for i in (100.0, 500.0) for j in (0.0, 100.0, 200.0, 300.0, 400.0)])
    chart = Chart(1, tuple("ABCDEFGHIJ"), np.c_[0 * pixels[:, 0], pixels], "mm", pixels)
    calibration, trials = calibrate(chart)
    assert calibration.camera(1).order == 1
    assert [trial.status for trial in trials][1:] == ["refused"] * 4


def test_too_few_points_or_a_line_are_refused() -> None:
    with pytest.raises(RefusedInput, match="camera 1: 3 control points, expected at least 4"):
        calibrate(third_order_chart(points=3))
    line = np.array([[n, 2.0 * n] for n in range(5)])
    with pytest.raises(RefusedInput, match="camera 1: the pixels of all control points lie on one line"):
        calibrate(Chart(1, tuple("ABCDE"), np.c_[line[:, 0], line], "mm", line))


def test_thesis_chart_as_the_thesis_has_it() -> None:
    charts = read_chart(DATA / "calibration_charts.csv")
    calibration, trials = calibrate(*charts.values(), model="quadratic")
    assert [camera.camera for camera in calibration.cameras] == [1, 2, 3, 4, 5, 6, 7, 8]
    assert all(trial.status == "determined" and "says nothing" in trial.remark for trial in trials)
    for camera_id, chart in charts.items():
        model = calibration.camera(camera_id)
        assert (model.centre_px, model.scale_px, model.held_out_rms_mm) == ((0, 0), 1, None)
        np.testing.assert_allclose(model.alpha_y, 10 * np.array(fit_quadratic(chart).alpha_y), rtol=1e-14)
        np.testing.assert_allclose(evaluate(model, chart.pixels), 10 * chart.world[:, 1:], atol=1e-6)


def test_quadratic_model_with_many_points_is_order_two() -> None:
    chart = third_order_chart(noise_px=0.5)
    plain, normalised = model_of(chart, model="quadratic"), model_of(chart, order=2)
    np.testing.assert_allclose(evaluate(plain, chart.pixels), evaluate(normalised, chart.pixels), atol=1e-8)
    assert plain.held_out_rms_mm == normalised.held_out_rms_mm
    assert plain.rms_mm == pytest.approx(normalised.rms_mm)


def test_parameters_that_contradict_each_other() -> None:
    with pytest.raises(ValueError, match="quadratic model has order 2"):
        ChartCalibrationParameters(model="quadratic", order=3)

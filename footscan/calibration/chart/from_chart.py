"""Calibration from a chart of control points."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chart.chart import Chart, most_spread
from footscan.calibration.chart.quadratic import ORDER as QUADRATIC
from footscan.calibration.chart.quadratic import QuadraticFit, fit_quadratic
from footscan.calibration.models.fit import ModelFit
from footscan.calibration.models.maps import Model
from footscan.calibration.models.observations import Observations, of_points
from footscan.calibration.models.polynomial import PolynomialModel, terms
from footscan.calibration.models.region import region_of
from footscan.calibration.models.selection import ModelTrial, candidates, requested_models, rms, select, try_model
from footscan.rows import distinct_rows
from schemas.base.errors import RefusedInput
from schemas.base.units import MILLIMETRES
from schemas.calibration import Calibration, CameraCalibration, Residual, Source
from schemas.parameters.calibration import CalibrationParameters

PLAIN_QUADRATIC = PolynomialModel(QUADRATIC, (0.0, 0.0), 1.0)
"""The model of the thesis, of pixels that are not normalised."""
FEWEST_POINTS = 4
"""Number of control points a camera needs: an affine map of the plane has three unknowns, and one more point shows how
well it fits."""


def calibrate_chart(
    charts: Mapping[int, Chart],
    *,
    parameters: CalibrationParameters,
    source: Source,
    software: str,
) -> tuple[Calibration, list[ModelTrial]]:
    """Calibrate cameras from charts. The order of the points does not matter.

    Parameters
    ----------
    charts : view -> chart, as `read_chart` returns them. The X of the points of a laser that is not the first one, less
        that of the first one's, says how far its plane is ahead.
    source : names the chart in messages and in the calibration.

    Returns
    -------
    The calibration, in mm, and the trials of all models, camera by camera.

    Raises
    ------
    RefusedInput
        A camera has too few control points, or they lie on one line, or do not determine the requested model.
    """
    if parameters.points is not None:
        charts = {view: most_spread(chart, parameters.points) for view, chart in charts.items()}
    cameras: list[CameraCalibration] = []
    trials: list[ModelTrial] = []
    for view in sorted(charts):
        camera, tried = _calibrate_camera(charts[view], parameters, source.name)
        cameras.append(of_laser(camera, charts[view].camera, charts[view].laser, _ahead_mm(view, charts)))
        trials += tried
    return Calibration(sources=[source], software=software, cameras=cameras), trials


def _ahead_mm(view: int, charts: Mapping[int, Chart]) -> float:
    """X of the points of a view minus X of the points of the first laser, mm; 0 if one of the two is not charted."""
    first = [_x_mm(chart) for chart in charts.values() if chart.laser == 1]
    if charts[view].laser == 1 or not first:
        return 0.0
    return round(float(np.median(_x_mm(charts[view])) - np.median(np.concatenate(first))), 6)


def _x_mm(chart: Chart) -> NDArray[np.float64]:
    return MILLIMETRES[chart.unit] * chart.world[:, 0]


def compare_models(chart: Chart, source: str = "chart") -> list[ModelTrial]:
    """Try every model on the chart of one camera, that of the thesis first.

    Raises
    ------
    RefusedInput
        The camera has too few control points, or they lie on one line.
    """
    _refuse_poor(chart, source)
    observations = observe(chart)
    tried = select(candidates(observations.pixels, chart.size.px), observations, chart.view, robust=False)[1]
    return [_thesis_trial(chart, observations), *tried]


def observe(chart: Chart) -> Observations:
    """Convert the control points of a camera to observations, in mm. Corners clicked twice are held out together."""
    return of_points(chart.pixels, MILLIMETRES[chart.unit] * chart.world[:, 1:], _groups(chart))


def _calibrate_camera(
    chart: Chart, parameters: CalibrationParameters, source: str
) -> tuple[CameraCalibration, list[ModelTrial]]:
    _refuse_poor(chart, source)
    observations = observe(chart)
    if parameters.model == "quadratic":
        return _quadratic(chart, observations)
    tried = requested_models(candidates(chart.pixels, chart.size.px), parameters)
    fitted, trials = select(tried, observations, chart.view, robust=False)
    if fitted is None and len(tried) == 1:  # a single requested model is used even if its error is unknown
        fitted, _ = try_model(tried[0], observations, chart.view, robust=False)
    if fitted is None:
        reasons = "; ".join(f"{trial.model}: {trial.remark or 'no point can be held out'}" for trial in trials[:1])
        raise RefusedInput(source, f"no model can be judged: {reasons}", field=f"camera {chart.name}")
    chosen = next((trial for trial in trials if trial.status == "chosen"), trials[0])
    return calibrated(fitted, observations, chosen, chart.size.px), trials


def _refuse_poor(chart: Chart, source: str) -> None:
    """Refuse control points that do not determine any model."""
    if len(chart.points) < FEWEST_POINTS:
        problem = f"{len(chart.points)} control points, expected at least {FEWEST_POINTS}"
        raise RefusedInput(source, problem, field=f"camera {chart.name}")
    if not region_of(chart.pixels):
        problem = "the pixels of all control points lie on one line, expected them to cover a region of the image"
        raise RefusedInput(source, problem, field=f"camera {chart.name}")


def calibrated(
    fitted: ModelFit, observations: Observations, trial: ModelTrial, image_px: tuple[int, int]
) -> CameraCalibration:
    """Build the entry of a camera in the calibration file."""
    covariance: list[list[float]] = []
    if fitted.covariance is not None:
        covariance = [row[: k + 1].tolist() for k, row in enumerate(fitted.covariance)]
    return CameraCalibration(
        camera=trial.camera,
        image_px=image_px,
        map=fitted.model.as_map(fitted.parameters),
        covariance=covariance,
        condition=fitted.condition,
        region_px=region_of(observations.pixels),
        points=observations.points,
        rms_mm=trial.rms_mm,
        held_out_rms_mm=trial.held_out_rms_mm,
        worst_mm=trial.worst_mm,
        residuals=_residuals(fitted.model, fitted.parameters, observations),
    )


def of_laser(calibration: CameraCalibration, camera: int, laser: int, ahead_mm: float) -> CameraCalibration:
    """The map of a view as that of a camera and a laser, whose plane stands ahead of the head by `ahead_mm`."""
    return calibration.model_copy(update={"camera": camera, "laser": laser, "ahead_mm": ahead_mm})


def _residuals(model: Model, parameters: NDArray[np.float64], observations: Observations) -> list[Residual]:
    """The residual at each place, in an order that does not depend on that of the observations."""
    ordered = observations.sorted()
    pixels, errors = ordered.errors(ordered.across(model.world(parameters, ordered.pixels)))
    rows = np.column_stack([pixels.round(2), errors.round(5)]).tolist()
    return [(i, j, y, z) for i, j, y, z in rows]


def _quadratic(chart: Chart, observations: Observations) -> tuple[CameraCalibration, list[ModelTrial]]:
    """Calibrate by the model of the thesis; its held-out error is that of the normalised polynomial of second order."""
    second_order = CalibrationParameters(model="polynomial", order=QUADRATIC)
    (normalised,) = requested_models(candidates(chart.pixels, chart.size.px), second_order)
    _, trial = try_model(normalised, observations, chart.view, robust=False)
    result = fit_quadratic(chart)
    parameters = _in_mm(result)
    world = MILLIMETRES[chart.unit] * chart.world[:, 1:]
    distances = np.linalg.norm(PLAIN_QUADRATIC.world(parameters, chart.pixels) - world, axis=1)
    worst = trial.worst_mm if trial.held_out_rms_mm is not None else float(distances.max())
    trial = replace(
        trial,
        model="quadratic",
        rms_mm=rms(distances),
        worst_mm=worst,
        status="chosen",
        remark=result.remark or "",
    )
    camera = CameraCalibration(
        camera=chart.camera,
        image_px=chart.size.px,
        map=PLAIN_QUADRATIC.as_map(parameters),
        region_px=region_of(chart.pixels),
        points=len(chart.points),
        rms_mm=trial.rms_mm,
        held_out_rms_mm=trial.held_out_rms_mm,
        worst_mm=trial.worst_mm,
        residuals=_residuals(PLAIN_QUADRATIC, parameters, observations),
    )
    return camera, [trial]


def _thesis_trial(chart: Chart, observations: Observations) -> ModelTrial:
    """Try the quadratic of the thesis, by its basic solution; each group of points is held out in turn."""
    world = MILLIMETRES[chart.unit] * chart.world[:, 1:]
    group = observations.group[: len(world)]
    distances = np.linalg.norm(_quadratic_world(chart, chart.pixels) - world, axis=1)
    held_out = np.array(distances)
    judged = bool(np.ptp(group) > 0)
    for number in np.unique(group) if judged else ():
        out = group == number
        held_out[out] = np.linalg.norm(_quadratic_world(_part(chart, ~out), chart.pixels[out]) - world[out], axis=1)
    worst = int(held_out.argmax())
    determined = observations.independent <= 2 * terms(QUADRATIC)
    return ModelTrial(
        camera=chart.view,
        model="quadratic of the thesis",
        unknowns=2 * terms(QUADRATIC),
        observations=observations.independent,
        points=observations.points,
        rms_mm=rms(distances),
        held_out_rms_mm=rms(held_out) if judged else None,
        region_sigma_mm=None,
        worst_mm=float(held_out[worst]),
        worst_point=worst,
        condition=None,
        status="determined" if determined else "tried",
        remark="passes through its points by construction" if determined else "",
    )


def _quadratic_world(chart: Chart, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Y and Z (N, 2), mm, of `pixels` (N, 2) by the quadratic of a chart."""
    return PLAIN_QUADRATIC.world(_in_mm(fit_quadratic(chart)), pixels)


def _in_mm(result: QuadraticFit) -> NDArray[np.float64]:
    """The coefficients (12,) of Y and Z, in mm."""
    return MILLIMETRES[result.unit] * np.array(result.alpha_y + result.alpha_z)


def _part(chart: Chart, chosen: NDArray[np.bool_]) -> Chart:
    """The points of a chart selected by `chosen` (N,)."""
    names = tuple(name for name, taken in zip(chart.points, chosen, strict=True) if taken)
    return replace(chart, points=names, world=chart.world[chosen], pixels=chart.pixels[chosen])


def _groups(chart: Chart) -> NDArray[np.intp]:
    """Number the points (N,), with equal numbers for points that share a world position or a pixel.

    The numbers depend on the positions of the points, not on their order.
    """
    places = np.column_stack([chart.world, chart.pixels])
    order = np.lexsort(places.T[::-1])
    group = np.empty(len(order), np.intp)
    group[order] = np.arange(len(order))
    for positions in (chart.world, chart.pixels):
        same = distinct_rows(positions).number
        for number in range(same.max() + 1):
            touched = np.isin(group, group[same == number])
            group[touched] = group[touched].min()
    return group

"""Calibration from charts: polynomials of several orders, and the choice among them by held-out error."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from footscan.calibration.chart import Chart
from footscan.calibration.polynomial import design_matrix, evaluate, terms
from footscan.calibration.quadratic import ORDER as QUADRATIC
from footscan.calibration.quadratic import fit_quadratic
from schemas.calibration import MILLIMETRES, Calibration, Point, PolynomialCamera
from schemas.errors import RefusedInput
from schemas.parameters.calibration import ChartCalibrationParameters

FEWEST_POINTS = 4
"""A plane has three unknowns, and one more point tells how well it fits."""
WORST_CONDITION = 1e7
"""Condition number of the normalised design matrix beyond which control points do not tell the terms apart."""


@dataclass(frozen=True)
class OrderTrial:
    """How well a polynomial of one order describes the chart of one camera."""

    camera: int
    order: int
    unknowns: int
    """Coefficients of Y, and as many of Z."""
    points: int
    rms_mm: float | None
    """Distance from the control points that it was fitted to, root mean square; None where there is no fit."""
    held_out_rms_mm: float | None
    """The same on points left out of the fit; None where none can be left out."""
    worst_mm: float | None
    """Largest distance from a control point, held out where that is known."""
    worst_point: str | None
    status: Literal["chosen", "tried", "determined", "refused"]
    """`determined`: it passes through its points by construction, so nothing is known of its error."""
    remark: str = ""


def calibrate_chart(
    charts: Mapping[int, Chart],
    *,
    parameters: ChartCalibrationParameters,
    source: str,
    source_sha256: str,
    software: str,
) -> tuple[Calibration, list[OrderTrial]]:
    """A calibration in mm from charts, and what each order achieved, camera by camera.

    `source` names the chart in messages and in the calibration.

    Raises
    ------
    RefusedInput
        A camera has too few control points, or they lie on one line, or cannot carry the order that was asked for.
    """
    cameras: list[PolynomialCamera] = []
    trials: list[OrderTrial] = []
    for camera_id in sorted(charts):
        chart = charts[camera_id]
        region = _region(chart, source)
        if parameters.model == "quadratic":
            model, rows = _quadratic(chart, region)
        else:
            model, rows = _polynomial(chart, region, parameters, source)
        cameras.append(model)
        trials += rows
    calibration = Calibration(source=source, source_sha256=source_sha256, software=software, cameras=cameras)
    return calibration, trials


def _region(chart: Chart, source: str) -> list[Point]:
    """Corners of the convex hull of the control pixels."""
    if len(chart.points) < FEWEST_POINTS:
        problem = f"{len(chart.points)} control points, expected at least {FEWEST_POINTS}"
        raise RefusedInput(source, problem, field=f"camera {chart.camera}")
    try:
        corners = chart.pixels[ConvexHull(chart.pixels).vertices]
    except QhullError:
        problem = "the pixels of all control points lie on one line, expected them to cover a region of the image"
        raise RefusedInput(source, problem, field=f"camera {chart.camera}") from None
    return [(float(i), float(j)) for i, j in corners]


def _polynomial(
    chart: Chart, region: list[Point], parameters: ChartCalibrationParameters, source: str
) -> tuple[PolynomialCamera, list[OrderTrial]]:
    """The polynomial of the order that was asked for, or else of that with the least held-out error."""
    highest = max(parameters.highest_order, parameters.order or 1)
    attempts = [_try_order(chart, region, order) for order in range(1, highest + 1)]
    trials = [trial for _, trial in attempts]
    if parameters.order is not None:
        chosen = parameters.order - 1
    else:
        chosen = min(range(highest), key=lambda index: _or_infinite(trials[index].held_out_rms_mm))
    model, trial = attempts[chosen]
    if model is None or (parameters.order is None and trial.held_out_rms_mm is None):
        problem = f"order {trial.order} cannot be fitted: {trial.remark or 'no point can be held out'}"
        raise RefusedInput(source, problem, field=f"camera {chart.camera}")
    if trial.status == "tried":
        trials[chosen] = replace(trial, status="chosen")
    return model, trials


def _or_infinite(value: float | None) -> float:
    return np.inf if value is None else value


def _try_order(chart: Chart, region: list[Point], order: int) -> tuple[PolynomialCamera | None, OrderTrial]:
    """Least squares in normalised coordinates, and the errors in mm."""
    points, unknowns = len(chart.points), terms(order)

    def refused(remark: str) -> tuple[None, OrderTrial]:
        trial = OrderTrial(chart.camera, order, unknowns, points, None, None, None, None, "refused", remark)
        return None, trial

    if points < unknowns:
        return refused(f"{points} points for {unknowns} unknowns")
    low, high = chart.pixels.min(axis=0), chart.pixels.max(axis=0)
    centre, scale = (low + high) / 2, float((high - low).max() / 2)
    normalised = (chart.pixels - centre) / scale
    matrix = design_matrix(normalised[:, 0], normalised[:, 1], order)
    if np.linalg.cond(matrix) > WORST_CONDITION:
        return refused("the points lie so that they do not tell all terms apart")
    q, r = np.linalg.qr(matrix)
    world = MILLIMETRES[chart.unit] * chart.world[:, 1:]
    alpha = np.linalg.solve(r, q.T @ world)
    residuals = world - matrix @ alpha
    held_out = _held_out_residuals(chart, q, residuals)
    rms = _rms(residuals)
    held_out_rms = None if held_out is None else _rms(held_out)
    model = PolynomialCamera(
        camera=chart.camera,
        order=order,
        centre_px=(float(centre[0]), float(centre[1])),
        scale_px=scale,
        alpha_y=alpha[:, 0].tolist(),
        alpha_z=alpha[:, 1].tolist(),
        region_px=region,
        points=points,
        rms_mm=rms,
        held_out_rms_mm=held_out_rms,
    )
    worst_mm, worst_point = _worst(chart, residuals if held_out is None else held_out)
    determined = points == unknowns
    remark = "passes through its points by construction" if determined else ""
    status: Literal["determined", "tried"] = "determined" if determined else "tried"
    return model, OrderTrial(
        chart.camera, order, unknowns, points, rms, held_out_rms, worst_mm, worst_point, status, remark
    )


def _held_out_residuals(
    chart: Chart, q: NDArray[np.float64], residuals: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Residuals (N, 2) of each point under the polynomial fitted without it; None where a point cannot be left out.

    Points at one world position or at one pixel are left out together: they are one corner, clicked twice. For a group
    g with the block H_gg of the hat matrix, the residuals are (I - H_gg)^-1 e_g (Cook & Weisberg 1982, section 3.2).
    """
    held_out = np.empty_like(residuals)
    group = _groups(chart)
    for number in np.unique(group):
        members = np.flatnonzero(group == number)
        left = np.eye(len(members)) - q[members] @ q[members].T
        if np.linalg.eigvalsh(left)[0] < 1.0 / WORST_CONDITION:
            return None
        held_out[members] = np.linalg.solve(left, residuals[members])
    return held_out


def _groups(chart: Chart) -> NDArray[np.intp]:
    """A number (N,) for each point, the same for points that share a world position or a pixel."""
    group = np.arange(len(chart.points))
    for positions in (chart.world, chart.pixels):
        same = np.unique(positions, axis=0, return_inverse=True)[1].ravel()
        for number in range(same.max() + 1):
            touched = np.isin(group, group[same == number])
            group[touched] = group[touched].min()
    return group


def _rms(residuals: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))


def _worst(chart: Chart, residuals: NDArray[np.float64]) -> tuple[float, str]:
    distances = np.hypot(residuals[:, 0], residuals[:, 1])
    index = int(distances.argmax())
    return float(distances[index]), chart.points[index]


def _quadratic(chart: Chart, region: list[Point]) -> tuple[PolynomialCamera, list[OrderTrial]]:
    """The thesis's model: second order of the plain pixels; its held-out error is that of any second order."""
    fit = fit_quadratic(chart)
    scale = MILLIMETRES[chart.unit]
    model = PolynomialCamera(
        camera=chart.camera,
        order=QUADRATIC,
        centre_px=(0.0, 0.0),
        scale_px=1.0,
        alpha_y=[scale * a for a in fit.alpha_y],
        alpha_z=[scale * a for a in fit.alpha_z],
        region_px=region,
        points=fit.points,
    )
    residuals = scale * chart.world[:, 1:] - evaluate(model, chart.pixels)
    _, trial = _try_order(chart, region, QUADRATIC)
    worst_mm, worst_point = trial.worst_mm, trial.worst_point
    if worst_mm is None or worst_point is None:
        worst_mm, worst_point = _worst(chart, residuals)
    rms = _rms(residuals)
    model = model.model_copy(update={"rms_mm": rms, "held_out_rms_mm": trial.held_out_rms_mm})
    trial = replace(
        trial,
        rms_mm=rms,
        worst_mm=worst_mm,
        worst_point=worst_point,
        status="determined" if fit.determined else "chosen",
        remark=fit.remark or "",
    )
    return model, [trial]

"""Selection of a camera's model by the error on held-out data."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.fit import ModelFit, UndeterminedError, fit, predict_without
from footscan.calibration.models.homography import HomographyModel, image_frame
from footscan.calibration.models.maps import Model
from footscan.calibration.models.observations import Observations
from footscan.calibration.models.polynomial import PolynomialModel
from footscan.calibration.models.region import region_of, supported
from schemas.parameters.calibration import CalibrationParameters

Floats = NDArray[np.float64]

LEAVE_ONE_OUT = 12
"""Number of groups up to which each is a fold of its own; more are dealt to `FOLDS` folds: a bound of time."""
FOLDS = 10
"""Number of folds."""
ORDERS = (1, 2, 3, 4, 5)
"""Orders of the polynomials that are tried."""
CORRECTIONS = (2, 3, 4)
"""Orders of the smooth correction that are tried."""
SMALLEST_EXTENT_PX = 1e-6
"""Lower bound of the scale of a polynomial: a single pixel has no extent."""
AS_GOOD = 1.02
"""Ratio of expected errors up to which a model with fewer unknowns is preferred. Chosen by hand."""
REGION_GRID = 16
"""Places a side at which the uncertainty is sampled in the region between the data."""


@dataclass(frozen=True)
class ModelTrial:
    """The result of fitting one model to the observations of a camera."""

    camera: int
    model: str
    unknowns: int
    observations: int
    """Number of independent observations; a control point gives two."""
    points: int
    rms_mm: float | None
    """Root mean square distance from the fitted data; None without a fit."""
    held_out_rms_mm: float | None
    """Root mean square distance on held-out data; None if no data can be held out."""
    region_sigma_mm: float | None
    """Predicted standard deviation of (Y, Z), root mean square over the region between the data."""
    worst_mm: float | None
    """Largest distance, on held-out data if there are any."""
    worst_point: int | None
    """The number of the point with that distance."""
    condition: float | None
    status: Literal["chosen", "tried", "determined", "refused"]
    """`determined`: the model passes through its points by construction, so that its error is unknown."""
    remark: str = ""


def candidates(pixels: Floats, image_px: tuple[int, int]) -> list[Model]:
    """List all models: polynomials normalised to the extent of `pixels` (N, 2), homographies to the image.

    >>> [model.name for model in candidates(np.array([[0.0, 0.0], [639.0, 479.0]]), (640, 480))][4:7]
    ['polynomial 5', 'homography', 'homography, distortion']
    """
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    centre = ((low + high) / 2).tolist()
    extent = max(float((high - low).max() / 2), SMALLEST_EXTENT_PX)
    middle, reach = image_frame(image_px)
    return [
        *(PolynomialModel(order, (centre[0], centre[1]), extent) for order in ORDERS),
        HomographyModel(middle, reach),
        HomographyModel(middle, reach, True),
        *(HomographyModel(middle, reach, True, order) for order in CORRECTIONS),
    ]


def requested_models(models: Sequence[Model], parameters: CalibrationParameters) -> list[Model]:
    """Select the models that the parameters admit."""
    return [
        model
        for model in models
        if parameters.model in ("auto", model.kind)
        and (not isinstance(model, PolynomialModel) or parameters.order in (None, model.order))
    ]


def select(
    models: Sequence[Model], observations: Observations, camera: int, *, robust: bool
) -> tuple[ModelFit | None, list[ModelTrial]]:
    """Select the model with the least expected error.

    Held-out data lie where the data lie, perhaps on few lines. They do not show the error in the region between, where
    a model with many unknowns may oscillate and one without distortion is too stiff. There the covariance predicts the
    error. The squares of both are added.

    Returns
    -------
    The fit of the selected model, None if no model can be judged; and the trials of all `models`, in their order.
    """
    attempts = [try_model(model, observations, camera, robust=robust) for model in models]
    trials = _with_a_lens(models, [trial for _, trial in attempts])
    judged = [k for k, trial in enumerate(trials) if np.isfinite(_expected(trial))]
    if not judged:
        return None, trials
    least = min(_expected(trials[k]) for k in judged)
    near = [k for k in judged if _expected(trials[k]) <= AS_GOOD * least]
    chosen = min(near, key=lambda k: (trials[k].unknowns, _expected(trials[k])))
    trials[chosen] = replace(trials[chosen], status="chosen")
    return attempts[chosen][0], trials


def _with_a_lens(models: Sequence[Model], trials: list[ModelTrial]) -> list[ModelTrial]:
    """Raise the predicted standard deviation of each trial to that of the homography with distortion.

    The covariance of a model without distortion ignores what a lens may do between the data.
    """
    with_distortion = [
        trial.region_sigma_mm
        for model, trial in zip(models, trials, strict=True)
        if model.kind == "homography-distortion" and trial.region_sigma_mm
    ]
    return [
        replace(trial, region_sigma_mm=max([trial.region_sigma_mm, *with_distortion]))
        if trial.region_sigma_mm
        else trial
        for trial in trials
    ]


def try_model(
    model: Model, observations: Observations, camera: int, *, robust: bool
) -> tuple[ModelFit | None, ModelTrial]:
    """Fit one model, and measure its errors; without a fit if the observations do not determine it."""
    observations = observations.sorted()
    common = ModelTrial(
        camera, model.name, model.unknowns, observations.independent, observations.points,
        None, None, None, None, None, None, "refused",
    )  # fmt: skip
    try:
        fitted = fit(model, observations, robust=robust)
    except UndeterminedError as undetermined:
        return None, replace(common, remark=str(undetermined))
    held_out = held_out_residuals(fitted, observations, robust=robust)
    residuals = fitted.residuals if held_out is None else held_out
    distances = observations.distances(residuals)
    worst = int(distances.argmax())
    determined = observations.independent == model.unknowns
    return fitted, replace(
        common,
        rms_mm=rms(observations.distances(fitted.residuals)),
        held_out_rms_mm=None if held_out is None else rms(distances),
        region_sigma_mm=_region_sigma(fitted, observations.pixels),
        worst_mm=float(distances[worst]),
        worst_point=int(np.unique(observations.point)[worst]),
        condition=fitted.condition,
        status="determined" if determined else "tried",
        remark="passes through its points by construction" if determined else "",
    )


def held_out_residuals(fitted: ModelFit, observations: Observations, *, robust: bool) -> Floats | None:
    """Cross-validate a fit: residuals (N,), mm, of each observation under the model fitted without its fold of groups.

    None if the other folds do not determine the model.
    """
    fold = _folds(observations.group)
    if fold.max(initial=0) == 0:
        return None
    try:
        return predict_without(fitted.model, observations, fold, robust=robust)
    except UndeterminedError:
        return None


def rms(distances: Floats) -> float:
    """Root mean square of `distances` (N,); the same to the bit in any order.

    >>> rms(np.array([3.0, 0.0, 0.0, 4.0]))
    2.5
    """
    return float(np.sqrt(np.mean(np.sort(distances**2))))


def _expected(trial: ModelTrial) -> float:
    """The expected error of a trial, mm; infinite if it is unknown."""
    if trial.held_out_rms_mm is None or trial.region_sigma_mm is None:
        return np.inf
    return float(np.hypot(trial.held_out_rms_mm, trial.region_sigma_mm))


def _region_sigma(fitted: ModelFit, pixels: Floats) -> float | None:
    """The predicted standard deviation over the convex hull of `pixels` (N, 2), mm."""
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    i, j = np.meshgrid(*(np.linspace(low[k], high[k], REGION_GRID) for k in (0, 1)))
    grid = np.column_stack([i.ravel(), j.ravel()])
    grid = grid[supported(region_of(pixels), grid)]
    return fitted.region_sigma(grid)


def _folds(group: NDArray[np.intp]) -> NDArray[np.intp]:
    """The fold (N,) of each observation; groups are dealt to the folds in turn."""
    number = np.unique(group, return_inverse=True)[1]
    return number if number.max(initial=0) < LEAVE_ONE_OUT else number % FOLDS

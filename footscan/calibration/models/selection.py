"""The choice among models of a camera, by the error on what was held out of the fit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.fit import Fit, UndeterminedError, fit, predict
from footscan.calibration.models.homography import HomographyModel, image_frame
from footscan.calibration.models.maps import Model
from footscan.calibration.models.observations import Observations
from footscan.calibration.models.polynomial import PolynomialModel
from footscan.calibration.models.region import region_of, supported
from schemas.parameters.calibration import CalibrationParameters

Floats = NDArray[np.float64]

LEAVE_ONE_OUT = 12
"""Up to so many groups each is held out by itself; more are dealt out to `FOLDS` folds."""
FOLDS = 10
ORDERS = (1, 2, 3, 4, 5)
"""Orders of the polynomials that are tried."""
CORRECTIONS = (2, 3, 4)
"""Orders of the smooth correction that are tried."""
SMALLEST_EXTENT_PX = 1e-6
AS_GOOD = 1.02
"""A model with fewer unknowns is taken where its expected error is this near to the least."""
REGION_GRID = 16
"""Places a side at which the region between the data is looked at."""


@dataclass(frozen=True)
class ModelTrial:
    """How well a model describes what a camera saw."""

    camera: int
    model: str
    unknowns: int
    observations: int
    """Whose errors have nothing to do with each other; a control point gives two."""
    points: int
    rms_mm: float | None
    """Distance from what it was fitted to, root mean square; None where there is no fit."""
    held_out_rms_mm: float | None
    """The same on what was left out of the fit; None where nothing can be left out."""
    region_sigma_mm: float | None
    """Standard deviation of what the model says of (Y, Z), root mean square over the region between the data."""
    worst_mm: float | None
    """Largest distance, held out where that is known."""
    worst_point: int | None
    """The number of the point that has it."""
    condition: float | None
    status: Literal["chosen", "tried", "determined", "refused"]
    """`determined`: it passes through its points by construction, so nothing is known of its error."""
    remark: str = ""


def candidates(pixels: Floats, image_px: tuple[int, int]) -> list[Model]:
    """All models: polynomials normalised to the extent of `pixels` (N, 2), homographies to the image."""
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


def asked_for(models: Sequence[Model], parameters: CalibrationParameters) -> list[Model]:
    """Those that the parameters leave to choose from."""
    return [
        model
        for model in models
        if parameters.model in ("auto", model.kind)
        and (not isinstance(model, PolynomialModel) or parameters.order in (None, model.order))
    ]


def select(
    models: Sequence[Model], observations: Observations, camera: int, *, robust: bool
) -> tuple[Fit | None, list[ModelTrial]]:
    """The fit of the model with the least expected error, and how each fared; None where none can be judged.

    What is held out lies where the data lie, on few lines perhaps: it tells nothing of the region between them, where a
    model with many unknowns is free to swing, and one without a lens is stiff. How far off it may be there, covariances
    say; the two are added as squares.
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
    """No model can be surer between the data than the homography with a lens, whose covariance knows what a lens may
    do there: a model without one leaves that out of its own."""
    known = [
        trial.region_sigma_mm
        for model, trial in zip(models, trials, strict=True)
        if model.kind == "homography-distortion" and trial.region_sigma_mm
    ]
    return [
        replace(trial, region_sigma_mm=max([trial.region_sigma_mm, *known])) if trial.region_sigma_mm else trial
        for trial in trials
    ]


def try_model(model: Model, observations: Observations, camera: int, *, robust: bool) -> tuple[Fit | None, ModelTrial]:
    """The fit of one model, and its errors in mm."""
    observations = observations.sorted()
    common = ModelTrial(
        camera, model.name, model.unknowns, observations.independent, observations.points,
        None, None, None, None, None, None, "refused",
    )  # fmt: skip
    try:
        found = fit(model, observations, robust=robust)
    except UndeterminedError as undetermined:
        return None, replace(common, remark=str(undetermined))
    held_out = held_out_residuals(found, observations, robust=robust)
    residuals = found.residuals if held_out is None else held_out
    distances = observations.distances(residuals)
    worst = int(distances.argmax())
    determined = observations.independent == model.unknowns
    return found, replace(
        common,
        rms_mm=rms(observations.distances(found.residuals)),
        held_out_rms_mm=None if held_out is None else rms(distances),
        region_sigma_mm=_region_sigma(found, observations.pixels),
        worst_mm=float(distances[worst]),
        worst_point=int(np.unique(observations.point)[worst]),
        condition=found.condition,
        status="determined" if determined else "tried",
        remark="passes through its points by construction" if determined else "",
    )


def held_out_residuals(found: Fit, observations: Observations, *, robust: bool) -> Floats | None:
    """Residuals (N,), mm, of each observation under the model fitted without its group, or without its fold of groups.

    None where the rest does not determine the model.
    """
    residuals = np.empty(len(observations))
    fold = _folds(observations.group)
    if fold.max(initial=0) == 0:
        return None
    for number in range(int(fold.max()) + 1):
        held_out = fold == number
        try:
            rest = fit(found.model, observations.part(~held_out), robust=robust)
        except UndeterminedError:
            return None
        residuals[held_out] = predict(rest, observations.part(held_out))
    return residuals


def rms(distances: Floats) -> float:
    """Root mean square; the same to the bit in every order."""
    return float(np.sqrt(np.mean(np.sort(distances**2))))


def _expected(trial: ModelTrial) -> float:
    if trial.held_out_rms_mm is None or trial.region_sigma_mm is None:
        return np.inf
    return float(np.hypot(trial.held_out_rms_mm, trial.region_sigma_mm))


def _region_sigma(found: Fit, pixels: Floats) -> float | None:
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    i, j = np.meshgrid(*(np.linspace(low[k], high[k], REGION_GRID) for k in (0, 1)))
    grid = np.column_stack([i.ravel(), j.ravel()])
    grid = grid[supported(region_of(pixels), grid)]
    return found.region_sigma(grid)


def _folds(group: NDArray[np.intp]) -> NDArray[np.intp]:
    """The fold (N,) of each observation; groups are dealt out one by one."""
    number = np.unique(group, return_inverse=True)[1]
    return number if number.max(initial=0) < LEAVE_ONE_OUT else number % FOLDS

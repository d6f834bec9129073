"""Robust least-squares fit of a model's parameters, with their covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.maps import Model
from footscan.calibration.models.observations import Observations
from footscan.compiled import compiled
from footscan.robust import MAD_TO_SD, TUKEY
from schemas.calibration import LARGEST

Floats = NDArray[np.float64]

WORST_CONDITION = 1e7
"""Condition number from which the observations do not determine the parameters. Chosen by hand, below 1e8, up to which
the normal matrix shows it."""
STEPS = 40
"""Steps of a minimisation at most: a bound of time."""
ROUNDS = 4
"""How often the weights of outliers are updated: a bound of time."""
LEAST_SPREAD_MM = 0.01
"""Lower bound of the residuals' standard deviation, so that exact data have no outliers. Chosen by hand."""
ATTEMPTS = 12
"""Dampings that are tried for a step."""
REGULARISATION, FIRST_DAMPING, DAMPING_FACTOR = 1e-14, 1e-6, 10.0
"""Damping, relative to the scaled normal matrix: of every step, so that the matrix is regular; of the first damped
step; and the ratio of each damping to the next."""
CONVERGED, CONVERGED_MM2 = 1e-12, 1e-24
"""Decrease of the squares at which a minimisation ends: relative, and absolute."""


@dataclass(frozen=True)
class ModelFit:
    """A model with fitted parameters."""

    model: Model
    parameters: Floats
    """(P,)."""
    covariance: Floats | None
    """(P, P) of the parameters; None if there are as many unknowns as observations, so that no residuals remain."""
    condition: float
    """Condition number of the scaled Jacobian."""
    residuals: Floats
    """(N,) normal . (Y, Z) - offset, mm."""

    def region_sigma(self, pixels: Floats) -> float | None:
        """Predicted standard deviation of (Y, Z) at `pixels` (N, 2), mm, root mean square over them.

        None if there is no covariance or no pixel.
        """
        if self.covariance is None or not len(pixels):
            return None
        by_parameters = self.model.by_parameters(self.parameters, pixels)
        variances = np.einsum("nkp,pq,nkq->n", by_parameters, self.covariance, by_parameters, optimize=True)
        return float(np.sqrt(np.mean(variances)))


class UndeterminedError(Exception):
    """The observations do not determine the parameters."""


def fit(model: Model, observations: Observations, *, robust: bool) -> ModelFit:
    """Fit a model by least squares of the distances from the observed lines (Levenberg-Marquardt).

    Each block counts as one observation, however many pixels it has. With `robust`, outliers lose their weight.

    Raises
    ------
    UndeterminedError
        There are more unknowns than independent observations, or the observations do not determine the unknowns.

    Examples
    --------
    A camera with 0.5 mm a px, from nine control points:

    >>> from footscan.calibration.models.observations import of_points
    >>> from footscan.calibration.models.polynomial import PolynomialModel
    >>> pixels = np.array([[i, j] for i in (0.0, 320.0, 640.0) for j in (0.0, 240.0, 480.0)])
    >>> observations = of_points(pixels, 0.5 * pixels, np.arange(9))
    >>> camera = fit(PolynomialModel(1, (320.0, 240.0), 320.0), observations, robust=False)
    >>> print(camera.parameters.round(6) + 0.0)
    [160. 160.   0. 120.   0. 160.]
    """
    if observations.independent < model.unknowns:
        raise UndeterminedError(f"{observations.independent} observations for {model.unknowns} unknowns")
    share = observations.share
    start = model.start(observations.pixels, observations.normals, observations.offsets)
    weights = share
    parameters = _minimise(model, observations, weights, start)
    for _ in range(ROUNDS if robust else 0):
        weights = share * (1.0 - _remoteness(_residuals(model, observations, parameters))) ** 2
        parameters = _minimise(model, observations, weights, parameters)
    jacobian = _jacobian(model, observations, parameters)
    normal, _ = _normal_equations(jacobian, weights, np.zeros(len(weights)))
    condition = _condition(normal + np.diag(model.prior_precision()))
    if not (condition < WORST_CONDITION and np.abs(parameters).max() <= LARGEST):
        raise UndeterminedError("the arrangement of the data does not determine all unknowns")
    residuals = _residuals(model, observations, parameters)
    remoteness = _remoteness(residuals) if robust else np.zeros(len(residuals))
    covariance = _covariance(observations, jacobian, residuals, remoteness, model.prior_precision())
    return ModelFit(model, parameters, covariance, condition, residuals)


def predict(fitted: ModelFit, observations: Observations) -> Floats:
    """Residuals (N,), mm, of observations under a fit to the same or to other observations."""
    return _residuals(fitted.model, observations, fitted.parameters)


def _residuals(model: Model, observations: Observations, parameters: Floats) -> Floats:
    return observations.across(model.world(parameters, observations.pixels))


def _jacobian(model: Model, observations: Observations, parameters: Floats) -> Floats:
    return _along(observations.normals, model.by_parameters(parameters, observations.pixels))


def _remoteness(residuals: Floats) -> Floats:
    """(residual / least residual without weight)^2, 1 at most; the weight of Tukey's biweight is (1 - that)^2."""
    spread = max(MAD_TO_SD * float(np.median(np.abs(residuals))), LEAST_SPREAD_MM)
    return np.asarray(np.clip((residuals / (TUKEY * spread)) ** 2, None, 1.0))


def _minimise(model: Model, observations: Observations, weights: Floats, start: Floats) -> Floats:
    """The parameters of the least weighted squares; steps that do not lower the squares are damped and repeated."""
    precision = model.prior_precision()

    def cost_of(parameters: Floats) -> tuple[float, Floats]:
        residuals = _residuals(model, observations, parameters)
        return float(np.sum(weights * residuals**2) + np.sum(precision * parameters**2)), residuals

    parameters = start
    cost, residuals = cost_of(parameters)
    if not np.isfinite(cost):
        raise UndeterminedError("no homography maps the pixels near their world points")
    damping = 0.0
    for _ in range(STEPS):
        jacobian = _jacobian(model, observations, parameters)
        normal, gradient = _normal_equations(jacobian, weights, residuals)
        normal += np.diag(precision)
        gradient += precision * parameters
        scale = np.sqrt(np.diagonal(normal))
        scale[scale == 0.0] = 1.0
        scaled = normal / np.outer(scale, scale)
        for _ in range(ATTEMPTS):
            damped = scaled + max(damping, REGULARISATION) * np.eye(len(scale))
            step = -np.linalg.solve(damped, gradient / scale) / scale
            lower, moved = cost_of(parameters + step)
            if lower <= cost:
                break
            damping = max(DAMPING_FACTOR * damping, FIRST_DAMPING)
        else:
            return parameters
        parameters, residuals = parameters + step, moved
        damping = 0.0 if damping <= FIRST_DAMPING else damping / DAMPING_FACTOR
        if cost - lower <= CONVERGED * cost + CONVERGED_MM2:
            break
        cost = lower
    return parameters


@compiled
def _along(normals: Floats, by_parameters: Floats) -> Floats:
    """(N, P) components along the normals (N, 2) of derivatives (N, 2, P)."""
    along = np.empty((by_parameters.shape[0], by_parameters.shape[2]))
    for n in range(along.shape[0]):
        for p in range(along.shape[1]):
            along[n, p] = normals[n, 0] * by_parameters[n, 0, p] + normals[n, 1] * by_parameters[n, 1, p]
    return along


@compiled
def _normal_equations(jacobian: Floats, weights: Floats, residuals: Floats) -> tuple[Floats, Floats]:
    """J^T W J and J^T W r, without BLAS, whose sums depend on the number of its threads."""
    unknowns = jacobian.shape[1]
    normal, gradient = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
    for n in range(jacobian.shape[0]):
        for p in range(unknowns):
            weighted = weights[n] * jacobian[n, p]
            gradient[p] += weighted * residuals[n]
            for q in range(p + 1):
                normal[p, q] += weighted * jacobian[n, q]
    for p in range(unknowns):
        for q in range(p):
            normal[q, p] = normal[p, q]
    return normal, gradient


def _condition(normal: Floats) -> float:
    """Condition number of the weighted Jacobian, prior included, with its columns scaled to equal length.

    That is within sqrt P of the best scaling (A. van der Sluis, "Condition numbers and equilibration of matrices",
    Numerische Mathematik 14, 1969, 14-23, doi:10.1007/BF02165096). It is computed from the normal matrix, which shows
    condition numbers up to about 1e8.
    """
    lengths = np.sqrt(np.diagonal(normal))
    if not lengths.all() or not np.isfinite(lengths).all():
        return np.inf
    spectrum = np.linalg.eigvalsh(normal / np.outer(lengths, lengths))
    return float(np.sqrt(spectrum[-1] / spectrum[0])) if spectrum[0] > 0.0 else np.inf


def _covariance(
    observations: Observations, jacobian: Floats, residuals: Floats, remoteness: Floats, precision: Floats
) -> Floats | None:
    """The covariance (P, P) of the parameters: the variance of a block times the inverse of the normal matrix.

    The variance is that of the blocks' mean residuals, since common errors of neighbours do not average out. Residuals
    enter by their influence, with a factor for the loss of efficiency by the weights (P. J. Huber, "Robust regression:
    asymptotics, conjectures and Monte Carlo", Annals of Statistics 1(5), 1973, 799-821, doi:10.1214/aos/1176342503).
    Without outliers (`remoteness` zero) this is the ordinary covariance of least squares.
    """
    share = observations.share
    pulls = np.bincount(
        np.unique(observations.block, return_inverse=True)[1], share * residuals * (1.0 - remoteness) ** 2
    )
    blocks, unknowns = len(pulls), jacobian.shape[1]
    slopes = (1.0 - remoteness) * (1.0 - 5.0 * remoteness)  # derivative of the influence by the residual
    slope = float(np.sum(share * slopes)) / blocks
    if blocks <= unknowns or slope <= 0.0:
        return None
    few = 1.0 + unknowns / blocks * float(np.sum(share * (slopes - slope) ** 2)) / blocks / slope**2
    variance = few**2 * float(np.sum(pulls**2)) / (blocks - unknowns)
    normal, _ = _normal_equations(jacobian, share, residuals)
    covariance = variance / slope * _inverse(slope * normal + np.diag(precision))
    return np.asarray((covariance + covariance.T) / 2)


def _inverse(normal: Floats) -> Floats:
    """The inverse of a normal matrix (P, P), computed in scaled form."""
    scale = np.sqrt(np.diagonal(normal))
    return np.asarray(np.linalg.inv(normal / np.outer(scale, scale)) / np.outer(scale, scale))

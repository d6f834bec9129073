"""The parameters of a model that bring pixels closest to where they belong, and how sure they are."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.maps import Model
from footscan.calibration.models.observations import Observations
from footscan.compiled import compiled
from footscan.robust import MAD_TO_SD
from schemas.calibration import LARGEST

Floats = NDArray[np.float64]

WORST_CONDITION = 1e7
"""Condition number beyond which the observations do not tell the parameters apart."""
STEPS = 40
ROUNDS = 4
"""How often the weights of outliers are found anew."""
TUKEY = 4.685
"""Residuals beyond so many standard deviations have no weight (Tukey's biweight, 95 % efficient)."""
LEAST_SPREAD_MM = 0.01
"""Residuals of exact data are no reason to call the largest of them outliers."""


@dataclass(frozen=True)
class Fit:
    """A model with the parameters that were found."""

    model: Model
    parameters: Floats
    """(P,)."""
    covariance: Floats | None
    """(P, P); None where there are as many unknowns as observations, which leave nothing to judge by."""
    condition: float
    residuals: Floats
    """(N,) normal . (Y, Z) - offset, mm."""

    def region_sigma(self, pixels: Floats) -> float | None:
        """Standard deviation, mm, of what the model says of (Y, Z) at `pixels` (N, 2), root mean square over them; None
        where it is not known."""
        if self.covariance is None or not len(pixels):
            return None
        by_parameters = self.model.by_parameters(self.parameters, pixels)
        variances = np.einsum("nkp,pq,nkq->n", by_parameters, self.covariance, by_parameters, optimize=True)
        return float(np.sqrt(np.mean(variances)))


class UndeterminedError(Exception):
    """The observations do not determine the parameters."""


def fit(model: Model, observations: Observations, *, robust: bool) -> Fit:
    """Least squares of the distances from the observed lines, in mm, by the method of Levenberg and Marquardt.

    Each block of observations counts as one, however many pixels it has. With `robust`, outliers lose their weight.

    Raises
    ------
    UndeterminedError
        More unknowns than the observations carry, or observations that do not tell them apart.
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
        raise UndeterminedError("the data lie so that they do not tell all unknowns apart")
    residuals = _residuals(model, observations, parameters)
    remoteness = _remoteness(residuals) if robust else np.zeros(len(residuals))
    covariance = _covariance(observations, jacobian, residuals, remoteness, model.prior_precision())
    return Fit(model, parameters, covariance, condition, residuals)


def predict(found: Fit, observations: Observations) -> Floats:
    """Residuals (N,), mm, of observations that the fit need not have seen."""
    return _residuals(found.model, observations, found.parameters)


def _residuals(model: Model, observations: Observations, parameters: Floats) -> Floats:
    return observations.across(model.world(parameters, observations.pixels))


def _jacobian(model: Model, observations: Observations, parameters: Floats) -> Floats:
    return _along(observations.normals, model.by_parameters(parameters, observations.pixels))


def _remoteness(residuals: Floats) -> Floats:
    """(residual / largest with weight)^2, 1 for those beyond: the weight of Tukey's biweight is (1 - that)^2."""
    spread = max(MAD_TO_SD * float(np.median(np.abs(residuals))), LEAST_SPREAD_MM)
    return np.asarray(np.clip((residuals / (TUKEY * spread)) ** 2, None, 1.0))


def _minimise(model: Model, observations: Observations, weights: Floats, start: Floats) -> Floats:
    """The parameters of the least weighted squares; steps that do not lower them are damped and tried again."""
    precision = model.prior_precision()

    def cost_of(parameters: Floats) -> tuple[float, Floats]:
        residuals = _residuals(model, observations, parameters)
        return float(np.sum(weights * residuals**2) + np.sum(precision * parameters**2)), residuals

    parameters = start
    cost, residuals = cost_of(parameters)
    if not np.isfinite(cost):
        raise UndeterminedError("no homography takes the pixels near to where they belong")
    damping = 0.0
    for _ in range(STEPS):
        jacobian = _jacobian(model, observations, parameters)
        normal, gradient = _normal_equations(jacobian, weights, residuals)
        normal += np.diag(precision)
        gradient += precision * parameters
        scale = np.sqrt(np.diagonal(normal))
        scale[scale == 0.0] = 1.0
        scaled = normal / np.outer(scale, scale)
        for _ in range(12):
            damped = scaled + max(damping, 1e-14) * np.eye(len(scale))
            step = -np.linalg.solve(damped, gradient / scale) / scale
            lower, moved = cost_of(parameters + step)
            if lower <= cost:
                break
            damping = max(10.0 * damping, 1e-6)
        else:
            return parameters
        parameters, residuals = parameters + step, moved
        damping = 0.0 if damping <= 1e-6 else damping / 10.0
        if cost - lower <= 1e-12 * cost + 1e-24:
            break
        cost = lower
    return parameters


@compiled
def _along(normals: Floats, by_parameters: Floats) -> Floats:
    """(N, P) derivatives along the normals (N, 2), of those of places (N, 2, P)."""
    along = np.empty((by_parameters.shape[0], by_parameters.shape[2]))
    for n in range(along.shape[0]):
        for p in range(along.shape[1]):
            along[n, p] = normals[n, 0] * by_parameters[n, 0, p] + normals[n, 1] * by_parameters[n, 1, p]
    return along


@compiled
def _normal_equations(jacobian: Floats, weights: Floats, residuals: Floats) -> tuple[Floats, Floats]:
    """J^T W J and J^T W r. Not by BLAS, whose sums depend on the number of its threads."""
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
    """Of the weighted Jacobian, prior included, with its columns scaled to one length: within sqrt P the best scaling.

    From its normal matrix, which tells condition numbers up to about 1e8. A. van der Sluis, "Condition numbers and
    equilibration of matrices", Numer. Math. 14 (1969) 14-23.
    """
    lengths = np.sqrt(np.diagonal(normal))
    if not lengths.all() or not np.isfinite(lengths).all():
        return np.inf
    spectrum = np.linalg.eigvalsh(normal / np.outer(lengths, lengths))
    return float(np.sqrt(spectrum[-1] / spectrum[0])) if spectrum[0] > 0.0 else np.inf


def _covariance(
    observations: Observations, jacobian: Floats, residuals: Floats, remoteness: Floats, precision: Floats
) -> Floats | None:
    """The variance of a block times the inverse of the normal matrix.

    The variance is that of the blocks' mean residuals: what neighbours err in common does not average out. Residuals
    count as far as their weight lets them pull, and what the weights cost is made up for: P. J. Huber, "Robust
    regression: asymptotics, conjectures and Monte Carlo", Ann. Statist. 1 (1973) 799-821. Without outliers to guard
    against (`remoteness` zero) this is the ordinary covariance of least squares.
    """
    share = observations.share
    pulls = np.bincount(
        np.unique(observations.block, return_inverse=True)[1], share * residuals * (1.0 - remoteness) ** 2
    )
    blocks, unknowns = len(pulls), jacobian.shape[1]
    slopes = (1.0 - remoteness) * (1.0 - 5.0 * remoteness)  # of the pull by the residual
    slope = float(np.sum(share * slopes)) / blocks
    if blocks <= unknowns or slope <= 0.0:
        return None
    few = 1.0 + unknowns / blocks * float(np.sum(share * (slopes - slope) ** 2)) / blocks / slope**2
    variance = few**2 * float(np.sum(pulls**2)) / (blocks - unknowns)
    normal, _ = _normal_equations(jacobian, share, residuals)
    covariance = variance / slope * _inverse(slope * normal + np.diag(precision))
    return np.asarray((covariance + covariance.T) / 2)


def _inverse(normal: Floats) -> Floats:
    scale = np.sqrt(np.diagonal(normal))
    return np.asarray(np.linalg.inv(normal / np.outer(scale, scale)) / np.outer(scale, scale))

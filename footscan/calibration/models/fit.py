"""Robust least-squares fit of a model's parameters, with their covariance."""

from dataclasses import dataclass
from typing import NamedTuple

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
COARSE = 1e-4
"""The relative decrease where weights follow the residuals. The next step would move the maps of virtual cameras by
less than 1e-5 mm, the next weights by more."""


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
    problem = _Problem.of(model, observations)
    share = observations.share
    place, condition = _estimate(problem, share, problem.start(observations), robust=robust)
    remoteness = _remoteness(place.residuals, share) if robust else np.zeros(len(share))
    covariance = _covariance(observations, place.jacobian, place.residuals, remoteness, problem.precision)
    return ModelFit(model, place.parameters, covariance, condition, place.residuals)


def predict(fitted: ModelFit, observations: Observations) -> Floats:
    """Residuals (N,), mm, of observations under a fit to the same or to other observations."""
    return observations.across(fitted.model.world(fitted.parameters, observations.pixels))


def predict_without(model: Model, observations: Observations, fold: NDArray[np.intp], *, robust: bool) -> Floats:
    """Residuals (N,), mm, of the observations of each `fold` (N,) under a fit to the other folds.

    A block lies in one fold.

    Raises
    ------
    UndeterminedError
        The other folds do not determine the unknowns.
    """
    problem, share = _Problem.of(model, observations), observations.share
    residuals = np.empty(len(observations))
    for number in range(int(fold.max()) + 1):
        own = fold == number
        rest = np.where(own, 0.0, share)
        if (independent := round(rest.sum())) < model.unknowns:  # the shares of a block add up to 1
            raise UndeterminedError(f"{independent} observations for {model.unknowns} unknowns")
        start = problem.start(observations.part(~own))
        residuals[own] = _estimate(problem, rest, start, robust=robust)[0].residuals[own]
    return residuals


class _Place(NamedTuple):
    """A problem at some parameters."""

    parameters: Floats
    """(P,)."""
    residuals: Floats
    """(N,) mm."""
    jacobian: Floats
    """(N, P) their derivatives by the parameters."""


class _Problem(NamedTuple):
    """The observations as a fit needs them."""

    model: Model
    basis: Floats
    """(N, K) of the model."""
    normals: Floats
    """(N, 2)."""
    offsets: Floats
    """(N,) mm."""
    precision: Floats
    """(P,) of the model's prior."""

    @staticmethod
    def of(model: Model, observations: Observations) -> "_Problem":
        basis = model.basis(observations.pixels)
        return _Problem(model, basis, observations.normals, observations.offsets, model.prior_precision())

    def at(self, parameters: Floats) -> _Place:
        across, jacobian = self.model.linearised(parameters, self.basis, self.normals)
        return _Place(parameters, across - self.offsets, jacobian)

    def start(self, observations: Observations) -> _Place:
        """Where a fit to these or to a part of the observations starts."""
        return self.at(self.model.start(observations.pixels, observations.normals, observations.offsets))

    def cost(self, weights: Floats, place: _Place) -> float:
        """The weighted squares, those of the prior included, mm^2."""
        return float(np.sum(weights * place.residuals**2) + np.sum(self.precision * place.parameters**2))


def _estimate(problem: _Problem, share: Floats, place: _Place, *, robust: bool) -> tuple[_Place, float]:
    """The least weighted squares from a `place`, and the condition number; observations of no `share` have no part."""
    weights, converged = share, COARSE if robust else CONVERGED
    place = _minimise(problem, weights, place, converged)
    for _ in range(ROUNDS if robust else 0):
        weights = share * (1.0 - _remoteness(place.residuals, share)) ** 2
        place = _minimise(problem, weights, place, converged)
    normal, _ = _normal_equations(place.jacobian, weights, place.residuals)
    condition = _condition(normal + np.diag(problem.precision))
    if not (condition < WORST_CONDITION and np.abs(place.parameters).max() <= LARGEST):
        raise UndeterminedError("the arrangement of the data does not determine all unknowns")
    return place, condition


def _remoteness(residuals: Floats, share: Floats) -> Floats:
    """(residual / least residual without weight)^2, 1 at most; the weight of Tukey's biweight is (1 - that)^2.

    The spread is that of the observations that have a `share` (N,).
    """
    spread = max(MAD_TO_SD * float(np.median(np.abs(residuals[share > 0.0]))), LEAST_SPREAD_MM)
    return np.asarray(np.minimum((residuals / (TUKEY * spread)) ** 2, 1.0))


def _minimise(problem: _Problem, weights: Floats, place: _Place, converged: float) -> _Place:
    """The place of the least weighted squares; steps that do not lower the squares are damped and repeated.

    It ends with the step that lowers the squares by no more than the share `converged`.
    """
    cost = problem.cost(weights, place)
    if not np.isfinite(cost):
        raise UndeterminedError("no homography maps the pixels near their world points")
    damping = 0.0
    for _ in range(STEPS):
        normal, gradient = _normal_equations(place.jacobian, weights, place.residuals)
        diagonal = np.diagonal(normal) + problem.precision
        scale = np.where(diagonal > 0.0, np.sqrt(diagonal), 1.0)
        scaled = (normal + np.diag(problem.precision)) / np.outer(scale, scale)
        gradient = (gradient + problem.precision * place.parameters) / scale
        for _ in range(ATTEMPTS):
            damped = scaled + max(damping, REGULARISATION) * np.eye(len(scale))
            moved = problem.at(place.parameters - np.linalg.solve(damped, gradient) / scale)
            lower = problem.cost(weights, moved)
            if lower <= cost:
                break
            damping = max(DAMPING_FACTOR * damping, FIRST_DAMPING)
        else:
            return place
        place = moved
        damping = 0.0 if damping <= FIRST_DAMPING else damping / DAMPING_FACTOR
        if cost - lower <= converged * cost + CONVERGED_MM2:
            break
        cost = lower
    return place


@compiled
def _normal_equations(jacobian: Floats, weights: Floats, residuals: Floats) -> tuple[Floats, Floats]:
    """J^T W J and J^T W r, without BLAS, whose sums depend on the number of its threads.

    Four rows are added at a time: each number of the sum is then loaded and stored once for all four.
    """
    count, unknowns = jacobian.shape
    normal, gradient = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
    for n in range(0, count, 4):
        rest = max(0, 4 - (count - n))  # the last rows may be fewer: those before stand in for them, without weight
        a, b, c, d = n, n + 1 if rest < 3 else n, n + 2 if rest < 2 else n, n + 3 if rest < 1 else n
        w_b, w_c, w_d = (weights[b] if b > n else 0.0, weights[c] if c > n else 0.0, weights[d] if d > n else 0.0)
        for p in range(unknowns):
            by_a, by_b = weights[a] * jacobian[a, p], w_b * jacobian[b, p]
            by_c, by_d = w_c * jacobian[c, p], w_d * jacobian[d, p]
            gradient[p] += by_a * residuals[a] + by_b * residuals[b] + by_c * residuals[c] + by_d * residuals[d]
            for q in range(p + 1):
                normal[p, q] += (
                    by_a * jacobian[a, q] + by_b * jacobian[b, q] + by_c * jacobian[c, q] + by_d * jacobian[d, q]
                )
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
    scaled = normal / np.outer(scale, scale)
    # A singular matrix has no inverse; its pseudo-inverse leaves out what the data say nothing of.
    singular = np.linalg.matrix_rank(scaled, hermitian=True) < len(scaled)
    inverse = np.linalg.pinv(scaled, hermitian=True) if singular else np.linalg.inv(scaled)
    return np.asarray(inverse / np.outer(scale, scale))

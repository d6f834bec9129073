"""Measures how well passes over one object agree: figures of the stripe as curves of X, for a latency, play, share.

The curves, cubic splines, are fitted anew for each set of the three unknowns, and these by Gauss and Newton's steps
along what the curves cannot explain (variable projection: G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10 (1973)
413-432, with the Jacobian of L. Kaufman, BIT 15 (1975) 49-57).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.ndimage import uniform_filter1d

from footscan.capture.head_motion import HeadMotion
from footscan.robust import MAD_TO_SD

Floats = NDArray[np.float64]

DEGREE = 3
"""Degree of the splines; basis functions farther apart do not overlap, so that the normal equations are banded."""
FRAMES_A_KNOT = 3.0
"""Mean number of frames between two knots of a curve. Chosen by hand."""
CLUSTER_S = 0.5
"""Errors within this time may be correlated: a wrong report of the controller affects several frames."""
AROUND = 9
"""Number of frames, in the order of X, over which residuals are averaged for the weights. Chosen by hand."""
RIDGE = 1e-9
LEAST_FREEDOM = 0.05
"""Lower bound of 1 - leverage: it limits the weight of frames that determine the curve alone. Chosen by hand."""


@dataclass(frozen=True)
class PassFrames:
    """The frames of all passes."""

    figures: Floats
    """(N, M) figures of the stripe, each with about unit variance."""
    seconds: Floats
    """(N,) times of the frames by the camera's clock, s."""
    delay_s: Floats
    """(N,) delays of the frames."""
    of_pass: NDArray[np.intp]
    """(N,) number of the pass of each frame."""
    motions: Sequence[HeadMotion]
    """Motion of the head in each pass."""

    def places(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Return X of each frame (N,), and its derivatives (N, 3) by the unknowns: latency (s), play (mm) and share."""
        taken = self.seconds + unknown[2] * self.delay_s - unknown[0]
        x, speed = np.empty(len(taken)), np.empty(len(taken))
        for k, motion in enumerate(self.motions):
            own = self.of_pass == k
            x[own], speed[own], _ = motion.at(np.clip(taken[own], motion.seconds[0], motion.seconds[-1]))
        half_way = np.sign(speed) / 2.0
        return x - unknown[1] * half_way, np.stack([-speed, -half_way, speed * self.delay_s], axis=1)


@dataclass(frozen=True)
class Prior:
    """Prior of the unknowns, (3,) each."""

    expected: Floats
    information: Floats
    """One over the variance; 0 without prior knowledge."""


@dataclass(frozen=True)
class Agreement:
    """The fit of the curves for one set of unknowns."""

    frames: PassFrames
    unknown: Floats
    x: Floats
    """(N,) X of the frames, mm."""
    weights: Floats
    """(N,) weights of the frames."""
    residuals: Floats
    """(N, M) in units of `scale`."""
    held_out: Floats
    """(N, M) residuals under curves that were fitted without the frame, in the same unit."""
    slopes: Floats
    """(N, M) slopes of the curves, in the same unit per mm."""
    jacobian: Floats
    """(N, M, 3) derivatives of the predicted figures by the unknowns, projected onto what the curves cannot explain."""

    @property
    def cost(self) -> float:
        """Weighted sum of squares."""
        return float(np.sum(self.weights[:, None] * self.residuals**2))

    def step(self, prior: Prior) -> Floats:
        """Return the Gauss-Newton step of the unknowns, (3,)."""
        pull = np.einsum("n,nma,nm->a", self.weights, self.jacobian, self.residuals)
        pull += prior.information * (prior.expected - self.unknown)
        return np.asarray(np.linalg.solve(self._information(prior), pull))

    def covariance(self, prior: Prior) -> Floats:
        """Return the covariance (3, 3) of the unknowns; errors of frames within `CLUSTER_S` may be correlated.

        The sandwich estimator with residuals as of frames held out (HC3: J. G. MacKinnon and H. White, Journal of
        Econometrics 29 (1985) 305-325), summed over clusters.
        """
        bread = np.linalg.inv(self._information(prior))
        scores = np.einsum("n,nma,nm->na", self.weights, self.jacobian, self.held_out)
        at = np.floor(self.frames.seconds / CLUSTER_S).astype(np.int64) * 1000 + self.frames.of_pass
        _, cluster = np.unique(at, return_inverse=True)
        summed = np.stack([np.bincount(cluster, column) for column in scores.T], axis=1)
        # With few effective clusters, G of equal size, the estimate is too small by (G - 1) / G.
        effective = np.sum(summed**2, axis=0) ** 2 / np.maximum(np.sum(summed**4, axis=0), 1e-300)
        summed *= np.sqrt(effective / np.maximum(effective - 1.0, 0.5))
        return np.asarray(bread @ (summed.T @ summed + np.diag(prior.information)) @ bread)

    def local_weights(self) -> Floats:
        """Return weights (N,) of mean 1: the inverse of the mean square residual of the neighbours in X.

        Where the stripe appears suddenly, at an upright edge, no smooth curve follows: such places must not count.
        """
        order = np.argsort(self.x, kind="stable")
        squares = np.mean(self.held_out**2, axis=1)[order]
        around = uniform_filter1d(squares, min(AROUND, len(squares)), mode="nearest")
        weights = np.empty(len(squares))
        weights[order] = 1.0 / (around + 0.1 * np.median(around))
        return np.asarray(weights / weights.mean())

    def scale(self) -> Floats:
        """Return the root mean square residual of each figure (M,), in its own unit; 0.01 at least."""
        return np.asarray(np.sqrt(np.average(self.residuals**2, axis=0, weights=self.weights)).clip(0.01))

    def frame_sd_s(self) -> float:
        """Return the robust standard deviation of the time of a single frame that its residuals imply, s.

        The frames that say most of it are asked. Those at upright edges seem to, but no curve follows there: their
        weights are small.
        """
        times = self.jacobian[:, :, 0]
        information = np.sum(times**2, axis=1)
        counted = self.weights * information
        clear = counted >= np.quantile(counted, 0.8)
        errors = np.sum(times * self.residuals, axis=1)[clear] / information[clear]
        return float(MAD_TO_SD * np.median(np.abs(errors)))

    def _information(self, prior: Prior) -> Floats:
        information = np.einsum("n,nma,nmb->ab", self.weights, self.jacobian, self.jacobian)
        return np.asarray(information + np.diag(prior.information))


def agree(frames: PassFrames, unknown: Floats, scale: Floats, weights: Floats | None = None) -> Agreement:
    """Fit the curves for `unknown` (latency, play, share), with figures in units of `scale` (M,)."""
    x, changes = frames.places(unknown)
    weights = np.ones(len(x)) if weights is None else weights
    low, high = float(x.min()), float(x.max())
    knots = np.pad(np.linspace(low, high, max(int(len(x) / FRAMES_A_KNOT), 4)), DEGREE, mode="edge")
    basis = BSpline.design_matrix(x, knots, DEGREE)
    normal = basis.T @ sparse.diags_array(weights) @ basis
    bands = np.stack([np.pad(normal.diagonal(k), (0, k)) for k in range(DEGREE + 1)])
    bands[0] += RIDGE
    factor = (cholesky_banded(bands, lower=True), True)

    def fitted(values: Floats) -> Floats:
        return np.asarray(cho_solve_banded(factor, np.asarray(basis.T @ (weights[:, None] * values))))

    figures = frames.figures / scale
    curves = fitted(figures)
    slopes = np.asarray(BSpline(knots, curves, DEGREE).derivative()(x))
    ahead = (slopes[:, :, None] * changes[:, None, :]).reshape(len(x), -1)
    jacobian = (ahead - basis @ fitted(ahead)).reshape(*slopes.shape, 3)
    residuals = figures - basis @ curves
    rows = basis.T.toarray()
    leverage = weights * np.einsum("kn,kn->n", cho_solve_banded(factor, rows), rows)
    held_out = residuals / np.maximum(1.0 - leverage, LEAST_FREEDOM)[:, None]
    return Agreement(frames, unknown, x, weights, residuals, held_out, slopes, jacobian)

"""Scale and weights of residuals among which some are wrong."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MAD_TO_SD = 1.4826
"""Standard deviation of a normal distribution over the median of its absolute deviations: 1 / Phi^-1(3/4)."""
TUKEY = 4.685
"""Residual, in standard deviations, from which an observation has no weight by Tukey's biweight: 95 % efficiency for
normal errors (A. E. Beaton and J. W. Tukey, Technometrics 16(2), 1974, doi:10.1080/00401706.1974.10489171)."""
HUBER = 1.345
"""Residual, in standard deviations, up to which an observation counts in full by Huber's weights: 95 % efficiency for
normal errors (P. J. Huber, Annals of Mathematical Statistics 35(1), 1964, doi:10.1214/aoms/1177703732)."""
CAUCHY = 2.385
"""Scale of Cauchy's weights, in standard deviations: 95 % efficiency for normal errors (P. W. Holland and R. E. Welsch,
Communications in Statistics 6(9), 1977, doi:10.1080/03610927708827533)."""


def huber_weights(residuals: Floats) -> Floats:
    """Weights (N,) of residuals (N,), in standard deviations: they converge from any start.

    >>> print(huber_weights(np.array([1.0, -2.69])))
    [1.  0.5]
    """
    return np.asarray(HUBER / np.maximum(np.abs(residuals), HUBER))


def tukey_weights(residuals: Floats) -> Floats:
    """Weights (N,) of residuals (N,), in standard deviations: those far off have none.

    >>> print(tukey_weights(np.array([0.0, 5.0])))
    [1. 0.]
    """
    return np.asarray(np.maximum(1.0 - (residuals / TUKEY) ** 2, 0.0) ** 2)


def cauchy_weights(residuals: Floats) -> Floats:
    """Weights (N,) of residuals (N,), in standard deviations: those far off have little, and the more so the farther.

    >>> print(cauchy_weights(np.array([0.0, 2.385])))
    [1.  0.5]
    """
    return np.asarray(1.0 / (1.0 + (residuals / CAUCHY) ** 2))

"""The calibration of the thesis: Y and Z as second-order polynomials of the pixel coordinates, not normalised."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from footscan.calibration.chart.chart import Chart
from footscan.calibration.models.polynomial import design_matrix, terms
from schemas.base.units import LengthUnit

ORDER = 2
"""Order of the polynomials."""


@dataclass(frozen=True)
class QuadraticFit:
    """Y and Z of one camera as polynomials of its pixels (i, j)."""

    camera: int
    unit: LengthUnit
    """Unit of Y and Z: the chart's own."""
    alpha_y: tuple[float, ...]
    """Coefficients of 1, i, j, i^2, ij, j^2."""
    alpha_z: tuple[float, ...]
    r2_y: float | None
    """1 - SSE / SST about the mean; None if all control points have the same Y."""
    r2_z: float | None
    points: int

    @property
    def determined(self) -> bool:
        """True if the polynomial passes through its points by construction, so that R^2 is always 1."""
        return self.points <= terms(ORDER)

    @property
    def remark(self) -> str | None:
        """A warning about the meaning of R^2; None if it is meaningful."""
        if not self.determined:
            return None
        return (
            f"{self.points} points and {terms(ORDER)} unknowns: the polynomial passes through its points by "
            "construction, so R^2 says nothing of the error between them"
        )


def fit_quadratic(chart: Chart) -> QuadraticFit:
    """Fit the least-squares polynomials of second order to a chart.

    If the points do not determine all terms, there are many solutions. This is the basic one, as of MATLAB's backslash
    operator: the terms that pivoting picks last are zero. With the five points of the thesis that is the constant term,
    and the result is the coefficients of the thesis.
    """
    matrix = design_matrix(chart.pixels[:, 0], chart.pixels[:, 1], ORDER)
    world = chart.world[:, 1:]
    alpha = _basic_solution(matrix, world)
    predicted = matrix @ alpha
    return QuadraticFit(
        camera=chart.camera,
        unit=chart.unit,
        alpha_y=tuple(alpha[:, 0].tolist()),
        alpha_z=tuple(alpha[:, 1].tolist()),
        r2_y=r_squared(world[:, 0], predicted[:, 0]),
        r2_z=r_squared(world[:, 1], predicted[:, 1]),
        points=len(chart.points),
    )


def r_squared(observed: NDArray[np.float64], predicted: NDArray[np.float64]) -> float | None:
    """Compute the coefficient of determination 1 - SSE / SST of (N,) values; None if all observed ones are equal.

    >>> r_squared(np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 4.0]))
    0.5
    """
    total = np.sum((observed - observed.mean()) ** 2)
    if np.ptp(observed) == 0:
        return None
    return float(1.0 - np.sum((observed - predicted) ** 2) / total)


def _basic_solution(matrix: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least squares by QR with column pivoting; the number of non-zero coefficients is the rank of the matrix.

    The columns are not scaled, since that would change their order in the pivoting. Householder QR is stable column by
    column, so that columns of different size do not reduce its accuracy.
    """
    q, r, order = qr(matrix, mode="economic", pivoting=True)
    diagonal = np.abs(np.diagonal(r))
    rank = int(np.sum(diagonal > max(matrix.shape) * np.finfo(np.float64).eps * diagonal[0]))
    solution = np.zeros((matrix.shape[1], values.shape[1]))
    solution[order[:rank]] = solve_triangular(r[:rank, :rank], q[:, :rank].T @ values)
    return solution

"""The thesis's calibration: Y and Z as second-order polynomials of the plain pixel coordinates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular

from footscan.calibration.chart.chart import Chart
from footscan.calibration.models.polynomial import design_matrix, terms
from schemas.base.units import LengthUnit

ORDER = 2


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
    """1 - SSE / SST about the mean; None where all control points have the same Y."""
    r2_z: float | None
    points: int

    @property
    def determined(self) -> bool:
        """Whether the polynomial passes through its points by construction: R^2 is 1 then and says nothing."""
        return self.points <= terms(ORDER)

    @property
    def remark(self) -> str | None:
        """What a reader of R^2 must know; None where it means what it seems to."""
        if not self.determined:
            return None
        return (
            f"{self.points} points and {terms(ORDER)} unknowns: the polynomial passes through its points by "
            "construction, so R^2 says nothing of the error between them"
        )


def fit_quadratic(chart: Chart) -> QuadraticFit:
    """The least-squares polynomials of second order of a chart.

    Where points are fewer than unknowns, or do not tell all terms apart, there are many solutions; this is the basic
    one, with the terms left at zero that pivoting picks last, as MATLAB's backslash has it. With the thesis's five
    points that is the constant term, and these are its coefficients.
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
    """Coefficient of determination 1 - SSE / SST of (N,) values; None where the observed ones are all the same.

    >>> r_squared(np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 4.0]))
    0.5
    """
    total = np.sum((observed - observed.mean()) ** 2)
    if np.ptp(observed) == 0:
        return None
    return float(1.0 - np.sum((observed - predicted) ** 2) / total)


def _basic_solution(matrix: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least squares by QR with column pivoting: as many coefficients other than zero as the matrix has rank.

    The columns are not scaled, since that would change which of them come first; Householder's QR is stable column by
    column, so their different sizes cost no accuracy.
    """
    q, r, order = qr(matrix, mode="economic", pivoting=True)
    diagonal = np.abs(np.diagonal(r))
    rank = int(np.sum(diagonal > max(matrix.shape) * np.finfo(np.float64).eps * diagonal[0]))
    solution = np.zeros((matrix.shape[1], values.shape[1]))
    solution[order[:rank]] = solve_triangular(r[:rank, :rank], q[:, :rank].T @ values)
    return solution

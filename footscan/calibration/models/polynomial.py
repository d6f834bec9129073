"""Polynomials of the pixel as a model of a camera."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from footscan.compiled import compiled
from schemas.calibration import PolynomialMap
from schemas.parameters.calibration import ModelName

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PolynomialModel:
    """Y and Z as polynomials of one order in u = (i - centre_i) / scale and v = (j - centre_j) / scale."""

    order: int
    centre_px: tuple[float, float]
    scale_px: float

    kind: ClassVar[ModelName] = "polynomial"

    @property
    def name(self) -> str:
        """Name of the model in tables."""
        return f"polynomial {self.order}"

    @property
    def unknowns(self) -> int:
        """Number of parameters P: the coefficients of Y and of Z."""
        return 2 * terms(self.order)

    def start(self, pixels: Floats, normals: Floats, offsets: Floats) -> Floats:
        """Parameters (P,) from which a fit starts: zeros, since the fit is linear."""
        del pixels, normals, offsets
        return np.zeros(self.unknowns)

    def prior_precision(self) -> Floats:
        """Weights (P,) of the squares of the parameters: zeros, since a polynomial has no prior."""
        return np.zeros(self.unknowns)

    def world(self, parameters: Floats, pixels: Floats) -> Floats:
        """Y and Z, (N, 2) mm, of `pixels` (N, 2), px."""
        matrix = design_matrix(*self._normalised(pixels), self.order)
        return sum_terms(matrix, parameters.reshape(2, -1))

    def by_parameters(self, parameters: Floats, pixels: Floats) -> Floats:
        """Derivatives (N, 2, P) of `world` by the parameters."""
        del parameters
        matrix = design_matrix(*self._normalised(pixels), self.order)
        jacobian = np.zeros((len(pixels), 2, self.unknowns))
        jacobian[:, 0, : matrix.shape[1]] = matrix
        jacobian[:, 1, matrix.shape[1] :] = matrix
        return jacobian

    def basis(self, pixels: Floats) -> Floats:
        """The terms (N, T) of `pixels` (N, 2), px, for `linearised`."""
        return design_matrix(*self._normalised(pixels), self.order)

    def linearised(self, parameters: Floats, basis: Floats, normals: Floats) -> tuple[Floats, Floats]:
        """The components of `world` along `normals` (N, 2), (N,) mm, and their derivatives (N, P) by the parameters."""
        jacobian = np.concatenate([normals[:, :1] * basis, normals[:, 1:] * basis], axis=1)
        return sum_terms(jacobian, parameters[np.newaxis])[:, 0], jacobian

    def by_pixels(self, parameters: Floats, pixels: Floats) -> Floats:
        """Derivatives (N, 2, 2) of `world` by i and j, mm/px."""
        by_u, by_v = derivatives(*self._normalised(pixels), self.order)
        alpha = parameters.reshape(2, -1).T
        return np.stack([by_u @ alpha, by_v @ alpha], axis=-1) / self.scale_px

    def as_map(self, parameters: Floats) -> PolynomialMap:
        """The map for the calibration file."""
        alpha_y, alpha_z = parameters.reshape(2, -1).tolist()
        return PolynomialMap(
            order=self.order, centre_px=self.centre_px, scale_px=self.scale_px, alpha_y=alpha_y, alpha_z=alpha_z
        )

    def _normalised(self, pixels: Floats) -> tuple[Floats, Floats]:
        u, v = ((pixels - np.array(self.centre_px)) / self.scale_px).T
        return u, v


def terms(order: int) -> int:
    """The number of terms of a polynomial of two variables.

    >>> [terms(order) for order in (1, 2, 3, 4, 5)]
    [3, 6, 10, 15, 21]
    """
    return (order + 1) * (order + 2) // 2


def design_matrix(u: ArrayLike, v: ArrayLike, order: int) -> Floats:
    """The terms at (u, v), each of shape (N,): an (N, terms) matrix in the order 1, u, v, u^2, uv, v^2, u^3, ...

    >>> design_matrix([2.0], [3.0], 2)
    array([[1., 2., 3., 4., 6., 9.]])
    """
    u, v = np.broadcast_arrays(np.asarray(u, np.float64), np.asarray(v, np.float64))
    return np.asarray(_design(u.ravel(), v.ravel(), order).reshape(*u.shape, terms(order)))


def derivatives(u: ArrayLike, v: ArrayLike, order: int) -> tuple[Floats, Floats]:
    """The derivatives of the terms by u and by v, two (N, terms) matrices in the order of `design_matrix`.

    >>> derivatives([2.0], [3.0], 2)
    (array([[0., 1., 0., 4., 3., 0.]]), array([[0., 0., 1., 0., 2., 6.]]))
    """
    u_power, v_power = _powers(u, order), _powers(v, order)
    by_u = [a * u_power[max(a - 1, 0)] * v_power[b] for a, b in _exponents(order)]
    by_v = [b * u_power[a] * v_power[max(b - 1, 0)] for a, b in _exponents(order)]
    return np.stack(by_u, axis=-1), np.stack(by_v, axis=-1)


@compiled
def sum_terms(matrix: Floats, coefficients: Floats) -> Floats:
    """(N, K) sums of the terms (N, T) with K sets of `coefficients` (K, T), in a fixed order of summation.

    >>> sum_terms(np.array([[1.0, 2.0]]), np.array([[3.0, 4.0], [0.0, 1.0]]))
    array([[11.,  2.]])
    """
    sums = np.zeros((len(matrix), len(coefficients)))
    for n in range(len(matrix)):
        for k in range(len(coefficients)):
            for t in range(matrix.shape[1]):
                sums[n, k] += matrix[n, t] * coefficients[k, t]
    return sums


@compiled
def _design(u: Floats, v: Floats, order: int) -> Floats:
    """The matrix of `design_matrix` for `u` and `v` (N,)."""
    matrix = np.empty((len(u), (order + 1) * (order + 2) // 2))
    u_power, v_power = np.ones(order + 1), np.ones(order + 1)
    for n in range(len(u)):
        for a in range(order):
            u_power[a + 1], v_power[a + 1] = u_power[a] * u[n], v_power[a] * v[n]
        t = 0
        for degree in range(order + 1):
            for b in range(degree + 1):
                matrix[n, t] = u_power[degree - b] * v_power[b]
                t += 1
    return matrix


def _exponents(order: int) -> list[tuple[int, int]]:
    """The exponents of u and v of each term."""
    return [(degree - k, k) for degree in range(order + 1) for k in range(degree + 1)]


def _powers(values: ArrayLike, order: int) -> list[Floats]:
    """The powers 0 to `order` of `values`."""
    base = np.asarray(values, np.float64)
    powers = [np.ones_like(base)]
    for _ in range(order):
        powers.append(powers[-1] * base)
    return powers

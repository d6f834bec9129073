"""Arithmetic that gives the same bytes on every x86-64 processor.

NumPy's `exp`, `sin` and `power` use other instructions on a processor with AVX-512, and give other last digits; BLAS,
behind `@`, uses kernels of its own for each processor. Films and captures are made without them, by single operations
of IEEE 754 in a fixed order. numba does not contract a multiplication and an addition unless `fastmath` is set.
"""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d

from footscan.compiled import compiled

Floats = NDArray[np.float64]
Border = Literal["reflect", "constant", "wrap"]

_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
"""ln 2 in two parts, the first with 33 bits: its product with a power's exponent is exact."""
_TERMS = 13
"""Terms of the series of exp for |x| <= ln(2) / 2: the next term is below 4e-18."""


def exp(x: Floats) -> Floats:
    """e to the power of each element, to 2 units in the last place; 0 below -708.

    x : float64, any shape, at most 709.

    Examples
    --------
    >>> exp(np.array([0.0, 1.0]))
    array([1.        , 2.71828183])
    """
    x = np.asarray(x, dtype=np.float64)
    return np.asarray(_exponentials(x.ravel()).reshape(x.shape))


def gaussian_kernel(sigma: float, reach: int) -> Floats:
    """Weights of a Gaussian of standard deviation `sigma` at -reach to reach, (2 * reach + 1,); their sum is 1."""
    weights = exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return np.asarray(weights / weights.sum())


def gaussian_blur(
    picture: NDArray[np.floating], sigma: float, *, truncate: float = 4.0, mode: Border = "reflect"
) -> NDArray[np.floating]:
    """`picture`, of any dimensions, through a Gaussian along each axis; as `scipy.ndimage.gaussian_filter`.

    sigma : in pixels. truncate : where the Gaussian ends, in sigmas. mode : what lies beyond the border.
    """
    if sigma <= 0.0:
        return picture.copy()
    kernel = gaussian_kernel(sigma, int(truncate * sigma + 0.5))
    for axis in range(picture.ndim):
        picture = correlate1d(picture, kernel, axis, output=picture.dtype, mode=mode)
    return picture


def dot(vectors: Floats, vector: Floats) -> Floats:
    """Returns the (N,) scalar products of each of `vectors` (N, K) with `vector` (K,)."""
    return np.asarray(np.einsum("ij,j->i", vectors, vector, optimize=False))


def product(vectors: Floats, matrix: Floats) -> Floats:
    """Returns (N, M), `vectors` (N, K) times `matrix` (K, M)."""
    return np.stack([dot(vectors, column) for column in matrix.T], axis=1)


def cos_sin(degrees: float) -> tuple[float, float]:
    """Cosine and sine of an angle."""
    return math.cos(math.radians(degrees)), math.sin(math.radians(degrees))


@compiled
def exponential(x: float) -> float:
    """`exp` of one number, within compiled loops."""
    if x < -708.0:
        return 0.0
    exponent = np.floor(x * 1.4426950408889634 + 0.5)  # 1 / ln 2
    rest = x - exponent * _LN2_HIGH - exponent * _LN2_LOW
    total = 1.0
    for term in range(_TERMS, 0, -1):
        total = 1.0 + total * rest / term
    return math.ldexp(total, int(exponent))


@compiled
def _exponentials(x: Floats) -> Floats:
    values = np.empty(len(x))
    for n in range(len(x)):
        values[n] = exponential(x[n])
    return values

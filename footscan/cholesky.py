"""Cholesky's method within compiled loops: for a small matrix a call of LAPACK takes longer, and depends on threads."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]

SMALLEST_PIVOT = 1e-12
"""Lower bound of a pivot: rounding."""
NEARLY_SINGULAR = 1e-9
"""Share that elimination leaves of a diagonal element, up to which the matrix counts as singular. Chosen by hand."""


@compiled
def factorise(matrix: Floats) -> bool:
    """Replace a symmetric matrix (K, K), of which the lower triangle is read, by its factor L, with L Lᵀ = matrix.

    Returns False if the matrix is singular or nearly so: pivots below `SMALLEST_PIVOT` are raised to it.

    >>> matrix = np.array([[4.0, 0.0], [2.0, 10.0]])
    >>> factorise(matrix), matrix.tolist()
    (True, [[2.0, 0.0], [1.0, 3.0]])
    """
    is_definite = True
    for k in range(len(matrix)):
        for m in range(k + 1):
            total = matrix[k, m]
            for n in range(m):
                total -= matrix[k, n] * matrix[m, n]
            if m < k:
                matrix[k, m] = total / matrix[m, m]
            else:
                is_definite &= total > NEARLY_SINGULAR * matrix[k, k]
                matrix[k, k] = np.sqrt(max(total, SMALLEST_PIVOT))
    return is_definite


@compiled
def solve_lower(factor: Floats, right: Floats) -> None:
    """Replace the right side (K,) by the solution x of L x = right.

    The square of x[k] is by how much term k, orthogonal to those before it, reduces the sum of squares of a fit.
    """
    for k in range(len(right)):
        for n in range(k):
            right[k] -= factor[k, n] * right[n]
        right[k] /= factor[k, k]


@compiled
def solve_factored(factor: Floats, right: Floats) -> None:
    """Replace the right side (K,) by the solution x of L Lᵀ x = right.

    >>> right = np.array([8.0, 22.0])
    >>> solve_factored(np.array([[2.0, 0.0], [1.0, 3.0]]), right)
    >>> right.tolist()
    [1.0, 2.0]
    """
    solve_lower(factor, right)
    for k in range(len(right) - 1, -1, -1):
        for n in range(k + 1, len(right)):
            right[k] -= factor[n, k] * right[n]
        right[k] /= factor[k, k]

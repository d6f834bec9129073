"""Least squares over the disagreements of all pairs of cameras: what was seen, summed up by stretch of the travel.

A comparison of cameras a and b says n . (D_a - D_b) = s, where D moves a point, n is the normal and s the distance
along it. Since D is linear in the coefficients of its camera, what a pair saw over a stretch is a quadratic form of the
difference of the coefficients of its two cameras, and any choice of terms and stretches is solved from these forms.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.motion import MOST
from footscan.compiled import compiled

Floats = NDArray[np.float64]

INDEPENDENT = 0.02
"""Neighbouring points err alike, for stripes are smoothed along: so many comparisons count as one when they are held
against what is known beforehand."""
PRIOR_MM = 0.3
"""Standard deviation of a coefficient before anything is seen."""


class Forms(NamedTuple):
    """By stretch, first and second camera: t' square t - 2 linear . t + constant, where t is how their coefficients
    differ."""

    square: Floats
    """(B, C, C, 12, 12)."""
    linear: Floats
    """(B, C, C, 12)."""
    constant: Floats
    """(B, C, C)."""
    weight: Floats
    """(B, C, C) the sum of the weights."""
    expected: Floats
    """(B, C, C) what would be left, weighted, by errors of the size that is to be expected."""


def sum_up(
    rows: Floats,
    distances: Floats,
    weights: Floats,
    variances: Floats,
    cameras: NDArray[np.intp],
    stretch: NDArray[np.intp],
    stretches: int,
    count: int,
) -> Forms:
    """The forms of M comparisons; only those of pairs (a, b) with a < b are filled.

    Parameters
    ----------
    rows : (M, 12) n . D of each term
    distances, weights, variances : (M,) s, mm; 1 / mm^2; and what is to be expected of its square, mm^2
    cameras : (M, 2) indices of the point's camera and of the other
    stretch : (M,) below `stretches`
    count : C, of the cameras
    """
    pairs = (stretches, count, count)
    forms = Forms(
        np.zeros((*pairs, MOST, MOST)), np.zeros((*pairs, MOST)), np.zeros(pairs), np.zeros(pairs), np.zeros(pairs)
    )
    _sum_up(rows, distances, weights, variances, cameras, stretch, forms)
    return forms


def solve(
    forms: Forms, stretches: NDArray[np.bool_], terms: NDArray[np.intp], precision: Floats | None = None
) -> Floats:
    """(C, 12) coefficients by what was seen over some stretches; only the first `terms` (C,) of each camera are not 0.

    `precision` (C,) holds all coefficients of a camera to 0, beyond what is known beforehand.
    """
    count = len(terms)
    square, linear = forms.square[stretches].sum(axis=0), forms.linear[stretches].sum(axis=0)
    matrix, right = np.zeros((count, MOST, count, MOST)), np.zeros((count, MOST))
    for a in range(count):
        for b in range(a + 1, count):
            matrix[a, :, a] += square[a, b]
            matrix[b, :, b] += square[a, b]
            matrix[a, :, b] -= square[a, b]
            matrix[b, :, a] -= square[a, b]
            right[a] += linear[a, b]
            right[b] -= linear[a, b]
    free = np.flatnonzero((np.arange(MOST) < terms[:, np.newaxis]).ravel())
    held = np.full((count, MOST), PRIOR_MM**-2)
    if precision is not None:
        held += precision[:, np.newaxis]
    normal = INDEPENDENT * matrix.reshape(count * MOST, count * MOST)[np.ix_(free, free)]
    normal[np.diag_indices(len(free))] += held.ravel()[free]
    solution = np.zeros(count * MOST)
    solution[free] = _solve_definite(normal, INDEPENDENT * right.ravel()[free])
    return solution.reshape(count, MOST)


def squares(forms: Forms, coefficients: Floats, stretches: NDArray[np.bool_]) -> Floats:
    """(S, C, C) weighted sums of the squares that coefficients (C, 12) leave, by stretch and pair."""
    apart = coefficients[:, np.newaxis] - coefficients[np.newaxis]
    taken = np.einsum("nabtu,abu->nabt", forms.square[stretches], apart) - 2.0 * forms.linear[stretches]
    left = forms.constant[stretches] + np.einsum("nabt,abt->nab", taken, apart)
    return np.asarray(np.maximum(left, 0.0))


@compiled
def _sum_up(
    rows: Floats,
    distances: Floats,
    weights: Floats,
    variances: Floats,
    cameras: NDArray[np.intp],
    stretch: NDArray[np.intp],
    forms: Forms,
) -> None:
    """Adds the comparisons to `forms`."""
    square, linear, constant, weight, expected = forms
    terms = rows.shape[1]
    for m in range(rows.shape[0]):
        a, b, n, w = cameras[m, 0], cameras[m, 1], stretch[m], weights[m]
        sign = 1.0
        if a > b:
            a, b, sign = b, a, -1.0
        for t in range(terms):
            weighted = w * rows[m, t]
            linear[n, a, b, t] += sign * weighted * distances[m]
            for u in range(terms):
                square[n, a, b, t, u] += weighted * rows[m, u]
        constant[n, a, b] += w * distances[m] ** 2
        weight[n, a, b] += w
        expected[n, a, b] += w * variances[m]


@compiled
def _solve_definite(matrix: Floats, right: Floats) -> Floats:
    """The solution (K,) for a positive definite matrix (K, K), by Cholesky's method; LAPACK's depends on threads."""
    size = len(right)
    lower = np.zeros((size, size))
    for k in range(size):
        for m in range(k + 1):
            total = matrix[k, m]
            for n in range(m):
                total -= lower[k, n] * lower[m, n]
            lower[k, m] = np.sqrt(max(total, 1e-12)) if k == m else total / lower[m, m]
    solution = right.copy()
    for k in range(size):
        for n in range(k):
            solution[k] -= lower[k, n] * solution[n]
        solution[k] /= lower[k, k]
    for k in range(size - 1, -1, -1):
        for n in range(k + 1, size):
            solution[k] -= lower[n, k] * solution[n]
        solution[k] /= lower[k, k]
    return solution

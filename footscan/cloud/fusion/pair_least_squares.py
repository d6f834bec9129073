"""Least squares over the disagreements of all pairs of cameras, as sums by stretch of the travel.

A comparison of cameras a and b is the equation n . (D_a - D_b) = s, where D is the motion of a point, n the normal and
s the distance along it. D is linear in the coefficients of its camera. So the squares of a pair in a stretch are a
quadratic form of the difference of the two cameras' coefficients. Any choice of terms and stretches is solved from
these forms.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cholesky import factorise, solve_factored
from footscan.cloud.fusion.motion import MOST_TERMS
from footscan.compiled import compiled

Floats = NDArray[np.float64]

INDEPENDENT = 0.02
"""Weight of a comparison against the prior. Errors of neighbouring points are correlated, since stripes are smoothed:
50 comparisons count as one. Chosen by hand."""
PRIOR_MM = 0.3
"""Prior standard deviation of a coefficient. Chosen by hand."""


class Forms(NamedTuple):
    """Quadratic forms t' square t - 2 linear . t + constant by stretch, first and second camera.

    t is the difference of the two cameras' coefficients.
    """

    square: Floats
    """(B, C, C, 12, 12)."""
    linear: Floats
    """(B, C, C, 12)."""
    constant: Floats
    """(B, C, C)."""
    weight: Floats
    """(B, C, C) the sum of the weights."""
    expected: Floats
    """(B, C, C) the weighted squares that remain if the errors are as expected."""


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
    """Sum up M comparisons; only the forms of pairs (a, b) with a < b are filled.

    Parameters
    ----------
    rows : (M, 12) n . D of each term
    distances : (M,) s, mm
    weights : (M,) 1 / mm^2
    variances : (M,) expected value of s^2, mm^2
    cameras : (M, 2) indices of the point's camera and of the other one
    stretch : (M,) the stretch of each comparison, from 0 to `stretches` - 1
    count : C, the number of cameras
    """
    pairs = (stretches, count, count)
    forms = Forms(
        np.zeros((*pairs, MOST_TERMS, MOST_TERMS)),
        np.zeros((*pairs, MOST_TERMS)),
        np.zeros(pairs),
        np.zeros(pairs),
        np.zeros(pairs),
    )
    _sum_up(rows, distances, weights, variances, cameras, stretch, forms)
    return forms


def solve(
    forms: Forms, stretches: NDArray[np.bool_], terms: NDArray[np.intp], precision: Floats | None = None
) -> Floats:
    """Solve for the coefficients of all cameras.

    Parameters
    ----------
    stretches : (B,) bool, the stretches to use
    terms : (C,) the number of terms of each camera; its other coefficients are 0
    precision : (C,) 1 / mm^2, additional prior precision of all coefficients of a camera about 0

    Returns
    -------
    (C, 12) float64, mm.
    """
    count = len(terms)
    square, linear = forms.square[stretches].sum(axis=0), forms.linear[stretches].sum(axis=0)
    matrix, right = np.zeros((count, MOST_TERMS, count, MOST_TERMS)), np.zeros((count, MOST_TERMS))
    for a in range(count):
        for b in range(a + 1, count):
            matrix[a, :, a] += square[a, b]
            matrix[b, :, b] += square[a, b]
            matrix[a, :, b] -= square[a, b]
            matrix[b, :, a] -= square[a, b]
            right[a] += linear[a, b]
            right[b] -= linear[a, b]
    free = np.flatnonzero((np.arange(MOST_TERMS) < terms[:, np.newaxis]).ravel())
    held = np.full((count, MOST_TERMS), PRIOR_MM**-2)
    if precision is not None:
        held += precision[:, np.newaxis]
    normal = INDEPENDENT * matrix.reshape(count * MOST_TERMS, count * MOST_TERMS)[np.ix_(free, free)]
    normal[np.diag_indices(len(free))] += held.ravel()[free]
    solution = np.zeros(count * MOST_TERMS)
    known = INDEPENDENT * right.ravel()[free]
    factorise(normal)
    solve_factored(normal, known)
    solution[free] = known
    return solution.reshape(count, MOST_TERMS)


def squares(forms: Forms, coefficients: Floats, stretches: NDArray[np.bool_]) -> Floats:
    """(S, C, C) weighted sums of the squares that coefficients (C, 12) leave, by selected stretch and pair."""
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
    """Add the comparisons to `forms`."""
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

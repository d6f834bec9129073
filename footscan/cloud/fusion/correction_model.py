"""Selection of the terms of motion of each camera: as few as explain the comparisons of the cameras."""

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.motion import TERMS
from footscan.cloud.fusion.pair_least_squares import Forms, solve, squares

Floats = NDArray[np.float64]

STRETCHES = 16
"""Number of equal stretches into which the travel is divided. Chosen by hand."""
FOLDS = 4
"""Number of sets of stretches, each of which is held out in turn. Chosen by hand."""
LEAST_GAIN = 0.25
"""Least gain of a term, relative to the squares of the camera's held-out comparisons and to the squares that the sigmas
predict. Stripes are slightly biased by the angle at which a camera sees the skin, over the whole travel: terms that
gain less follow that bias, away from the truth. Chosen by hand."""
GAIN_ERRORS = 2.0
"""Least gain of a term in units of its standard error over the stretches: about 95 % for normal errors."""
SHRINKINGS = 12
"""Iterations of the reweighted least squares: a bound of time."""
PENALTY = 50.0
"""Penalty on the length of a camera's motion, 1 / mm: it decides what the pairs leave undetermined, and little else.
Chosen by hand."""
SHORT_MM = 1e-3
"""Length below which a motion counts as none; keeps the weights finite."""
ALL_STRETCHES = np.ones(STRETCHES, np.bool_)
"""Selects all stretches."""


def choose_terms(forms: Forms, enough: NDArray[np.bool_], smallest_mm: float) -> NDArray[np.intp]:
    """Choose the number of terms of each camera: those that improve the agreement on held-out stretches.

    Parameters
    ----------
    forms : the comparisons of all pairs, in `STRETCHES` stretches.
    enough : (C,) bool, False for cameras with too few comparisons; they get no terms.
    smallest_mm : length of the coefficients below which a camera gets no terms.

    Returns
    -------
    (C,) int, values of `TERMS`.
    """
    terms = _sparse_rigid(forms, enough, smallest_mm)
    left = held_out(forms, terms)
    for k in np.flatnonzero(terms):
        fewer = terms.copy()
        fewer[k] = 0
        left_by_fewer = held_out(forms, fewer)
        if _gain(forms, left_by_fewer, left, int(k)) <= 0:
            terms, left = fewer, left_by_fewer
    while True:
        best, best_gain = None, 0.0
        for k in np.flatnonzero(enough):
            for more in (count for count in TERMS.values() if count > terms[k]):
                trial = terms.copy()
                trial[k] = more
                fitted = solve(forms, ALL_STRETCHES, trial)
                # Held-out data can hardly gain if the fitted data do not.
                if np.linalg.norm(fitted[k]) < smallest_mm or not _gain(
                    forms, left, squares(forms, fitted, ALL_STRETCHES), int(k)
                ):
                    continue
                left_by_trial = held_out(forms, trial)
                gain = _gain(forms, left, left_by_trial, int(k))
                if gain > best_gain:
                    best, best_gain = (trial, left_by_trial), gain
        if best is None:
            return terms
        terms, left = best


def hold_the_middle(coefficients: Floats, terms: NDArray[np.intp], enough: NDArray[np.bool_]) -> None:
    """Subtract the geometric median of the cameras' rigid motions from each; it is 0 if more than half do not move.

    The median is found by the iteration of E. Weiszfeld, Tohoku Mathematical Journal 43, 1937, 355-386.

    Parameters
    ----------
    coefficients : (C, 12) float64, mm, changed in place.
    terms : (C,) int, changed in place: cameras that move now have rigid terms at least.
    enough : (C,) bool, False for cameras that are left out.
    """
    if not np.any(terms) or 2 * np.count_nonzero(terms[enough] == 0) > np.count_nonzero(enough):
        return
    rigid = coefficients[enough, : TERMS["rigid"]]
    middle = rigid.mean(axis=0)
    for _ in range(SHRINKINGS):
        weights = 1.0 / (np.linalg.norm(rigid - middle, axis=1) + SHORT_MM)
        middle = np.sum(weights[:, np.newaxis] * rigid, axis=0) / weights.sum()
    coefficients[enough, : TERMS["rigid"]] -= middle
    terms[enough] = np.maximum(terms[enough], TERMS["rigid"])


def held_out(forms: Forms, terms: NDArray[np.intp]) -> Floats:
    """(B, C, C) weighted squares left in each stretch by coefficients that were fitted to other folds."""
    left = forms.constant.copy()
    fold = np.arange(STRETCHES) % FOLDS
    if np.any(terms):
        for k in range(FOLDS):
            left[fold == k] = squares(forms, solve(forms, fold != k, terms), fold == k)
    return left


def _sparse_rigid(forms: Forms, enough: NDArray[np.bool_], smallest_mm: float) -> NDArray[np.intp]:
    """(C,) the terms of rigid motions of as few cameras as explain the comparisons.

    The penalty on each camera's motion is its length, not its square (the group lasso: M. Yuan and Y. Lin, "Model
    selection and estimation in regression with grouped variables", Journal of the Royal Statistical Society B 68(1),
    2006, doi:10.1111/j.1467-9868.2005.00532.x), minimised by reweighted least squares.
    """
    rigid = TERMS["rigid"] * enough.astype(np.intp)
    precision = np.zeros(len(rigid))
    for _ in range(SHRINKINGS):
        length = np.linalg.norm(solve(forms, ALL_STRETCHES, rigid, precision), axis=1)
        precision = PENALTY / (length + SHORT_MM)
    return np.where(length >= smallest_mm, rigid, 0)


def _gain(forms: Forms, before: Floats, after: Floats, camera: int) -> float:
    """The decrease of the squares over all pairs; 0 if it is too small or not significant."""
    by_stretch = (before - after).sum(axis=(1, 2))
    gain = float(by_stretch.sum())
    of_camera = max(float(left[:, camera].sum() + left[:, :, camera].sum()) for left in (before, forms.expected))
    error = float(np.sqrt(len(by_stretch)) * by_stretch.std())
    return gain if gain > max(LEAST_GAIN * of_camera, GAIN_ERRORS * error) else 0.0

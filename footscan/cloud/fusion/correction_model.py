"""Which camera is given which terms of motion: as few as explain what the cameras see of each other."""

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.motion import TERMS
from footscan.cloud.fusion.pair_least_squares import Forms, solve, squares

Floats = NDArray[np.float64]

STRETCHES = 16
"""Into so many equal ones the travel is divided."""
FOLDS = 4
"""Each of so many sets of stretches is held out in turn."""
LEAST_GAIN = 0.25
"""A term has to take so much of the mean square off what a camera's held-out comparisons leave, and so much of what
points that are as sure as they say would leave. Stripes are biased a little by how obliquely a camera sees the skin,
over all of the travel: terms that gain less follow that bias, and take the points away from the truth."""
GAIN_ERRORS = 2.0
"""The gain has to be so many times its standard error over the stretches, too."""
SHRINKINGS = 12
PENALTY = 50.0
"""On the length of a camera's motion, 1 / mm: it decides what the pairs leave open, and little else."""
SHORT_MM = 1e-3
"""Motions are not told from none below this."""
EVERY = np.ones(STRETCHES, np.bool_)


def choose_terms(forms: Forms, enough: NDArray[np.bool_], smallest_mm: float) -> NDArray[np.intp]:
    """(C,) how many terms each camera is given: those that earn their place on what is held out.

    Cameras that are not seen `enough` (C,), or whose coefficients would be less than `smallest_mm`, get none.
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
                fitted = solve(forms, EVERY, trial)
                # What is held out can hardly gain where what was fitted to does not.
                if np.linalg.norm(fitted[k]) < smallest_mm or not _gain(
                    forms, left, squares(forms, fitted, EVERY), int(k)
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
    """Takes the geometric median of the rigid motions of all cameras off each; it is 0 where more than half stay."""
    if not np.any(terms) or 2 * np.count_nonzero(terms[enough] == 0) > np.count_nonzero(enough):
        return
    rigid = coefficients[enough, : TERMS["rigid"]]
    middle = rigid.mean(axis=0)
    for _ in range(SHRINKINGS):  # E. Weiszfeld, Tohoku Mathematical Journal 43 (1937) 355-386
        weights = 1.0 / (np.linalg.norm(rigid - middle, axis=1) + SHORT_MM)
        middle = np.sum(weights[:, np.newaxis] * rigid, axis=0) / weights.sum()
    coefficients[enough, : TERMS["rigid"]] -= middle
    terms[enough] = np.maximum(terms[enough], TERMS["rigid"])


def held_out(forms: Forms, terms: NDArray[np.intp]) -> Floats:
    """(B, C, C) what is left in each stretch by coefficients that were fitted to others."""
    left = forms.constant.copy()
    fold = np.arange(STRETCHES) % FOLDS
    if np.any(terms):
        for k in range(FOLDS):
            left[fold == k] = squares(forms, solve(forms, fold != k, terms), fold == k)
    return left


def _sparse_rigid(forms: Forms, enough: NDArray[np.bool_], smallest_mm: float) -> NDArray[np.intp]:
    """(C,) the terms of rigid motions of as few cameras as explain what was seen.

    Each camera's motion is penalised by its length, not by its square, found by reweighted least squares (the group
    lasso of Yuan and Lin 2006).
    """
    rigid = TERMS["rigid"] * enough.astype(np.intp)
    precision = np.zeros(len(rigid))
    for _ in range(SHRINKINGS):
        length = np.linalg.norm(solve(forms, EVERY, rigid, precision), axis=1)
        precision = PENALTY / (length + SHORT_MM)
    return np.where(length >= smallest_mm, rigid, 0)


def _gain(forms: Forms, before: Floats, after: Floats, camera: int) -> float:
    """How much less is left, over all pairs; 0 if that is too little for the camera's sake or may be chance."""
    by_stretch = (before - after).sum(axis=(1, 2))
    gain = float(by_stretch.sum())
    of_camera = max(float(left[:, camera].sum() + left[:, :, camera].sum()) for left in (before, forms.expected))
    error = float(np.sqrt(len(by_stretch)) * by_stretch.std())
    return gain if gain > max(LEAST_GAIN * of_camera, GAIN_ERRORS * error) else 0.0

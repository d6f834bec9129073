"""Motions of a camera's points in the laser plane: rigid or smooth."""

import numpy as np
from numpy.typing import NDArray

from schemas.fusion import Kind

Floats = NDArray[np.float64]

SCALE_MM = 50.0
"""Distance from the centre at which each term moves a point by about its coefficient. Chosen by hand."""
TERMS: dict[Kind, int] = {"none": 0, "rigid": 3, "affine": 6, "quadratic": 12}
"""Number of terms of each kind of motion; a kind contains the terms of the kinds before it."""
MOST_TERMS = TERMS["quadratic"]
"""Largest number of terms."""


def motion_terms(yz: Floats, centre: Floats, ranges: Floats) -> Floats:
    """Evaluate the terms of motion, in the order of `schemas.fusion.CameraCorrection`.

    Parameters
    ----------
    yz : (N, 2) float64, mm
    centre : (2,) mm
    ranges : (2, 2) or (N, 2, 2), least and greatest Y and Z, mm. For terms that are not rigid, points outside are moved
        to its border first, since a polynomial does not hold beyond the data that it was fitted to

    Returns
    -------
    (N, 2, 12) float64, the motion in Y and Z for a coefficient of 1.

    Examples
    --------
    The rigid terms of a point 50 mm beside the centre: two shifts and the rotation.

    >>> terms = motion_terms(np.array([[50.0, 0.0]]), np.zeros(2), np.array([[-60.0, -60.0], [60.0, 60.0]]))
    >>> print(terms[0, :, :3] + 0.0)
    [[1. 0. 0.]
     [0. 1. 1.]]
    """
    u, v = ((yz - centre) / SCALE_MM).T
    terms = np.zeros((len(yz), 2, MOST_TERMS))
    terms[:, 0, 0] = terms[:, 1, 1] = 1.0
    terms[:, 0, 2], terms[:, 1, 2] = -v, u
    u, v = ((np.clip(yz, ranges[..., 0, :], ranges[..., 1, :]) - centre) / SCALE_MM).T
    terms[:, 0, 3], terms[:, 1, 3] = u, v
    terms[:, 0, 4], terms[:, 1, 4] = u, -v
    terms[:, 0, 5], terms[:, 1, 5] = v, u
    for k, squared in enumerate((u * u, u * v, v * v)):
        terms[:, 0, 6 + k] = terms[:, 1, 9 + k] = squared
    return terms


def moved(yz: Floats, coefficients: Floats, centre: Floats, ranges: Floats) -> Floats:
    """Move points (N, 2) by one camera's coefficients (12,), all in mm; other parameters as for `motion_terms`.

    >>> shift = np.array([0.5, -0.5] + 10 * [0.0])
    >>> print(moved(np.array([[10.0, 20.0]]), shift, np.zeros(2), np.array([[0.0, 0.0], [50.0, 50.0]])))
    [[10.5 19.5]]
    """
    if not np.any(coefficients):
        return yz
    return np.asarray(yz + np.einsum("nkt,t->nk", motion_terms(yz, centre, ranges), coefficients))

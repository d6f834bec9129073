"""How a camera's points may be moved in the laser's plane: as a rigid body, or smoothly."""

import numpy as np
from numpy.typing import NDArray

from schemas.fusion import Kind

Floats = NDArray[np.float64]

SCALE_MM = 50.0
"""At this distance from the centre every term moves a point by about its coefficient."""
TERMS: dict[Kind, int] = {"none": 0, "rigid": 3, "affine": 6, "quadratic": 12}
"""Each kind has the terms of those before it, and more."""
MOST = TERMS["quadratic"]


def motion_terms(yz: Floats, centre: Floats, ranges: Floats) -> Floats:
    """(N, 2, 12) what each coefficient moves the points (N, 2) by, as `schemas.fusion.CameraCorrection` lists them.

    Terms that are not rigid take points outside of `ranges`, the (2, 2) or (N, 2, 2) least and greatest Y and Z, to its
    border first: a polynomial is good for nothing beyond what it was fitted to.
    """
    u, v = ((yz - centre) / SCALE_MM).T
    terms = np.zeros((len(yz), 2, MOST))
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
    """(N, 2) points moved by one camera's (12,) coefficients, mm."""
    if not np.any(coefficients):
        return yz
    return np.asarray(yz + np.einsum("nkt,t->nk", motion_terms(yz, centre, ranges), coefficients))

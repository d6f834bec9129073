"""Polynomials of fourth order in two variables, fitted to scattered heights; compiled, since there are many fits."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.robust import MAD_TO_SD

Floats = NDArray[np.float64]

ORDER = 4
POWERS = np.array([(n - j, j) for n in range(ORDER + 1) for j in range(n + 1)])
"""(15, 2) powers of the two variables in the terms, sorted by order"""
QUADRIC = 6
"""Number of terms of up to second order"""
REWEIGHTED = 3
"""Rounds of reweighting."""
TUKEY, LEAST_MISFIT_MM = 4.7, 0.04
"""Tuning constant of Tukey's biweight, 4.685 for 95 % efficiency; misfit of a polynomial to a smooth foot."""
LEAST_NOISE_MM = 0.01
"""Smaller scatter is not noise."""
LEAST_FREE = 0.2
"""Least share of the points that counts as degrees of freedom; chosen by hand."""
ENOUGH = 2
"""Points per term from which the noise is estimated by a fit without penalty; chosen by hand."""
RIDGE = 1e-9
"""Keeps the normal equations regular."""
NEWTON_STEPS, LONGEST_STEP = 3, 0.2
"""Steps towards a summit; the longest step, in radii."""
LEAST_BEND_MM = 0.1
"""A cap that bends less towards its border has no summit of its own; chosen by hand."""


@compiled
def robust_fit(places: Floats, height: Floats, noise: float, unevenness: float) -> tuple[Floats, float]:
    """Fit a polynomial over the unit circle; returns (15,) coefficients and the noise of the points, mm.

    The noise is -1 if too few points lie within. The weight of a point falls to zero at the border, and with the
    distance from the surface (Tukey's biweight).

    Parameters
    ----------
    places, height : (N, 2) in radii, (N,) mm
    noise : mm, a first estimate
    unevenness : mm, expected size of the terms of third and fourth order; the penalty suppresses larger ones
    """
    squared = places[:, 0] ** 2 + places[:, 1] ** 2
    inside = np.flatnonzero(squared < 1.0)
    count, size = len(inside), len(POWERS)
    if count < QUADRIC:
        return np.zeros(size), -1.0
    terms, heights = terms_at(places[inside]), height[inside]
    weight = (1.0 - squared[inside]) ** 2
    kept, away, factors = weight.copy(), np.empty(count), np.zeros(size)
    for _ in range(REWEIGHTED):
        both = np.zeros((size, size + 1))  # the right side, then the normal equations, which give the number of terms
        for k in range(count):
            for i in range(size):
                weighted = kept[k] * terms[k, i]
                both[i, 0] += weighted * heights[k]
                for j in range(i + 1):
                    both[i, j + 1] += weighted * terms[k, j]
        for i in range(size):
            for j in range(i):
                both[j, i + 1] = both[i, j + 1]
        solved = np.linalg.solve(both[:, 1:] + np.diag(held_back(noise, unevenness)), both)
        factors[:] = solved[:, 0]
        # The penalty grows with the noise and must not add to it: with enough points, the noise is estimated by a fit
        # without penalty.
        free = solved if count < ENOUGH * size else np.linalg.solve(both[:, 1:] + np.diag(np.full(size, RIDGE)), both)
        used = 0.0
        for i in range(size):
            used += free[i, i + 1]
        away[:] = np.abs(heights - terms @ np.ascontiguousarray(free[:, 0]))
        left = max(1.0 - used / count, LEAST_FREE)
        noise = max(MAD_TO_SD * np.sort(away)[count // 2] / np.sqrt(left), LEAST_NOISE_MM)
        off = (heights - terms @ factors) / (TUKEY * max(noise, LEAST_MISFIT_MM))
        kept[:] = weight * np.maximum(1.0 - off * off, 0.0) ** 2
    return factors, noise


@compiled
def terms_at(places: Floats) -> Floats:
    """Returns (N, 15) terms of the polynomial at (N, 2) places.

    Examples
    --------
    1, u, v, u², uv, v² and so on, at u = 2, v = 3:

    >>> terms_at(np.array([[2.0, 3.0]]))[0, :6].tolist()
    [1.0, 2.0, 3.0, 4.0, 6.0, 9.0]
    """
    terms = np.empty((len(places), len(POWERS)))
    powers = np.ones((2, ORDER + 1))
    for k in range(len(places)):
        for n in range(1, ORDER + 1):
            powers[0, n], powers[1, n] = powers[0, n - 1] * places[k, 0], powers[1, n - 1] * places[k, 1]
        for i in range(len(POWERS)):
            terms[k, i] = powers[0, POWERS[i, 0]] * powers[1, POWERS[i, 1]]
    return terms


@compiled
def held_back(noise: float, unevenness: float) -> Floats:
    """Returns (15,) weights that penalise the squares of the coefficients against those of the residuals.

    The penalty follows the part of the residuals that is noise, and not form that the polynomial misses.
    """
    hold = np.full(len(POWERS), RIDGE)
    hold[QUADRIC:] += max(noise**2 - LEAST_MISFIT_MM**2, LEAST_NOISE_MM**2) / unevenness**2
    return hold


@compiled
def slope(factors: Floats, place: Floats) -> tuple[Floats, Floats]:
    """Returns the gradient (2,) and the second derivatives (2, 2) at a place (2,)."""
    gradient, second = np.zeros(2), np.zeros((2, 2))
    u, v = place[0], place[1]
    for k in range(len(POWERS)):
        i, j = POWERS[k]
        if i > 0:
            gradient[0] += factors[k] * i * u ** (i - 1) * v**j
        if j > 0:
            gradient[1] += factors[k] * j * u**i * v ** (j - 1)
        if i > 1:
            second[0, 0] += factors[k] * i * (i - 1) * u ** (i - 2) * v**j
        if j > 1:
            second[1, 1] += factors[k] * j * (j - 1) * u**i * v ** (j - 2)
        if i > 0 and j > 0:
            second[0, 1] += factors[k] * i * j * u ** (i - 1) * v ** (j - 1)
    second[1, 0] = second[0, 1]
    return gradient, second


@compiled
def climb(factors: Floats, place: Floats) -> Floats:
    """Returns (2,) the summit near a place, by Newton's method; the place itself if there is no summit near it."""
    place = place.copy()
    for _ in range(NEWTON_STEPS):
        gradient, second = slope(factors, place)
        mean = (second[0, 0] + second[1, 1]) / 2
        apart = np.hypot((second[0, 0] - second[1, 1]) / 2, second[0, 1])
        if mean + apart > -LEAST_BEND_MM:  # the greater curvature
            break
        step = -np.linalg.solve(second, gradient)
        place += step * min(1.0, LONGEST_STEP / max(np.hypot(step[0], step[1]), 1e-12))
    return place

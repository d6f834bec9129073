"""Polynomials of fourth order in two variables, fitted to scattered heights; compiled, since there are many fits."""

import numpy as np
from numpy.typing import NDArray

from footscan.cholesky import factorise, solve_factored
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
    size, count = len(POWERS), 0
    inside, heights, weight = np.empty_like(places), np.empty(len(places)), np.empty(len(places))
    for k in range(len(places)):
        squared = places[k, 0] ** 2 + places[k, 1] ** 2
        if squared < 1.0:
            inside[count, 0], inside[count, 1] = places[k, 0], places[k, 1]
            heights[count], weight[count] = height[k], (1.0 - squared) ** 2
            count += 1
    if count < QUADRIC:
        return np.zeros(size), -1.0
    terms = terms_at(inside[:count])
    kept, away, factors = weight.copy(), np.empty(count), np.zeros(size)
    for _ in range(REWEIGHTED):
        normal, right = np.zeros((size, size)), np.zeros(size)
        for k in range(count):
            for i in range(size):
                weighted = kept[k] * terms[k, i]
                right[i] += weighted * heights[k]
                for j in range(i + 1):
                    normal[i, j] += weighted * terms[k, j]
        factors, used = _penalised_fit(normal, right, held_back(noise, unevenness))
        free = factors
        if count >= ENOUGH * size:
            # The penalty grows with the noise and must not add to it: with enough points, the noise is estimated by a
            # fit without penalty.
            free, used = _penalised_fit(normal, right, np.full(size, RIDGE))
        for k in range(count):
            away[k] = abs(heights[k] - _value(terms, k, free))
        left = max(1.0 - used / count, LEAST_FREE)
        noise = max(MAD_TO_SD * float(np.median(away)) / np.sqrt(left), LEAST_NOISE_MM)
        for k in range(count):
            off = (heights[k] - _value(terms, k, factors)) / (TUKEY * max(noise, LEAST_MISFIT_MM))
            kept[k] = weight[k] * max(1.0 - off * off, 0.0) ** 2
    return factors, noise


@compiled
def _penalised_fit(normal: Floats, right: Floats, held: Floats) -> tuple[Floats, float]:
    """Returns (15,) coefficients and how many of them the points determine: the trace of (N + penalty)⁻¹ N.

    Parameters
    ----------
    normal, right : (15, 15), of which the lower triangle is read, and (15,), the normal equations
    held : (15,) penalty of each coefficient
    """
    size = len(right)
    system, factors, column = normal.copy(), right.copy(), np.empty(size)
    for i in range(size):
        system[i, i] += held[i]
    factorise(system)
    solve_factored(system, factors)
    used = 0.0
    for i in range(size):
        for j in range(size):
            column[j] = normal[max(i, j), min(i, j)]
        solve_factored(system, column)
        used += column[i]
    return factors, used


@compiled
def _value(terms: Floats, k: int, factors: Floats) -> float:
    """The polynomial at point `k`, of which the (N, 15) `terms` are known."""
    value = 0.0
    for i in range(len(factors)):
        value += terms[k, i] * factors[i]
    return value


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
    for i in range(QUADRIC, len(POWERS)):
        hold[i] += max(noise**2 - LEAST_MISFIT_MM**2, LEAST_NOISE_MM**2) / unevenness**2
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
        determinant = second[0, 0] * second[1, 1] - second[0, 1] * second[0, 1]
        across = (second[0, 1] * gradient[1] - second[1, 1] * gradient[0]) / determinant
        along = (second[0, 1] * gradient[0] - second[0, 0] * gradient[1]) / determinant
        shortened = min(1.0, LONGEST_STEP / max(np.hypot(across, along), 1e-12))
        place[0] += across * shortened
        place[1] += along * shortened
    return place

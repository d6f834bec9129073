"""The farthest point of a surface in a direction: the summit of a polynomial fitted to the vertices around it.

The farthest vertex is a poor estimate: on a flat summit its place is arbitrary, and noise always puts it too far out. A
robust fit over a cap has neither fault (about 0.05 mm of error on a smooth foot with 0.3 mm of noise).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.measure.landmarks.polynomial import LEAST_MISFIT_MM, climb, held_back, robust_fit, slope, terms_at

Floats = NDArray[np.float64]
Point = Floats
"""(3,) mm"""
Window = tuple[tuple[float, float], tuple[float, float]]
"""Lower and upper bound along the two directions across, mm."""

STRAYS, COMPANIONS = 20, 2
"""Up to so many farthest points may be strays; a point with no more than so many companions is one. Chosen by hand."""
NEAR_MM = 6.0
"""Distance within which a point is a companion; radius of the first cap. Chosen by hand."""
RADIUS_MM = (2.5, 7.5, 16.0)
"""Least half axis of a cap, greatest one without noise, and greatest one with noise; chosen by hand."""
NOISE_WIDENS = 25.0
"""Growth in mm of the greatest half axis per mm of noise; chosen by hand."""
SPACINGS = 2.0
"""Least half axis of a cap in distances of neighbouring points; chosen by hand."""
ROUNDS = 6
"""Bound of time: rounds of fitting a cap and moving it to its summit."""
BORDER_MM = 0.8
"""A summit nearer than this to a bound of its window is one of the window, not of the surface; chosen by hand."""
GRID = 23
"""Places across a cap at which the polynomial is compared."""
SETTLED_MM = 0.004
"""The cap has settled when it moves by less."""
FLAT_MM = 0.01
"""Heights that differ by less count as equal: the middle of a blunt end is its summit. Chosen by hand."""
NOISES_DEEP, SCARCE_POWER, SCARCEST_MM = 5.0, 2 / 3, 2.0
"""Least depth of a cap in multiples of the noise where points are 1 mm apart; power of the points' distance with which
it grows, since fewer points need a wider cap; largest distance that counts. Chosen by hand."""
UNEVENNESS = 0.2
"""Size of the terms of third and fourth order at the border of a cap, as a share of its depth, that is expected of a
foot; the fit suppresses larger ones as noise. Chosen by hand."""


class Cap(NamedTuple):
    """The part of a surface over which a polynomial was fitted."""

    spread: Floats
    """(2, 2) matrix from mm across the direction of height, relative to its middle, to the unit circle"""
    depth: float
    """Height of its middle above its border, mm"""
    noise: float
    """Noise of the points about the polynomial, mm"""

    def held_back(self) -> Floats:
        """Returns (15,) weights that penalise the squares of the polynomial's coefficients."""
        return held_back(self.noise, UNEVENNESS * self.depth)


class Summit(NamedTuple):
    """The farthest point of a surface in a direction."""

    point: Point
    """(3,) mm"""
    residual: float
    """Standard deviation of the points of its cap about the fit, mm"""
    at_border: bool
    """True if the surface goes on rising across a bound of the window."""
    cap: Cap | None = None
    """The part of the surface that was fitted; None if no fit was possible."""


def summit(points: Floats, axis: int, sign: int, window: Window, depth: float) -> Summit | None:
    """Find the point of a surface that is farthest along `sign` times `axis` within a window.

    Parameters
    ----------
    points : (N, 3) float64, mm, of the surface; points outside the window support the fit at its border
    axis : 0, 1 or 2
    sign : 1 or -1
    window : mm, bounds along the other two axes, in their order
    depth : mm, of the cap that is fitted

    Returns
    -------
    The summit; None if the window holds fewer than three points

    Examples
    --------
    A sphere of radius 20 mm, whose summit lies between its points:

    >>> x, y = (values.ravel() for values in np.meshgrid(np.arange(-7.3, 8), np.arange(-7.6, 8)))
    >>> ball = np.column_stack([x, y, np.sqrt(400 - x**2 - y**2)])
    >>> top = summit(ball, axis=2, sign=1, window=((-5.0, 5.0), (-5.0, 5.0)), depth=1.0)
    >>> bool(np.abs(top.point - [0, 0, 20]).max() < 0.01), top.at_border
    (True, False)
    """
    across = [k for k in range(3) if k != axis]
    low, high = np.ascontiguousarray(np.array(window, np.float64).T)
    position, height = _within(points, axis, float(sign), low, high, -np.inf)
    if len(height) < 3:
        return None
    centre, top = _start(position, height, depth)
    wide = 2 * RADIUS_MM[2]
    position, height = _within(points, axis, float(sign), centre - wide, centre + wide, top - 4 * depth - 2.0)
    cap, fitted_cap = Cap(np.eye(2) / NEAR_MM, depth, LEAST_MISFIT_MM), None
    for round_ in range(ROUNDS):
        fitted = _fit(position - centre, height, cap)
        if fitted is None:
            break
        factors, noise = fitted
        cap = fitted_cap = cap._replace(noise=noise)
        moved, top = _highest(factors, centre, cap.spread, low, high)
        settled, centre = bool(np.all(np.abs(moved - centre) < SETTLED_MM)), moved
        if settled:
            break
        wanted = _cap(factors, cap, depth, position - centre)
        if round_ > 0:  # so that caps of two sizes do not alternate
            wanted = wanted._replace(spread=(cap.spread + wanted.spread) / 2, depth=(cap.depth + wanted.depth) / 2)
        cap = wanted
    point = np.empty(3)
    point[across], point[axis] = centre, sign * top
    at_border = bool(np.any((centre < low + BORDER_MM) | (centre > high - BORDER_MM)))
    return Summit(point, cap.noise, at_border, fitted_cap)


LINE = np.linspace(-1.0, 1.0, GRID)
"""(GRID,) places across a cap, in radii"""
DISC = np.array([(u, v) for u in LINE for v in LINE if u * u + v * v <= 1.0])
"""(D, 2) even places on a cap, in radii"""


@compiled
def _within(points: Floats, axis: int, sign: float, low: Floats, high: Floats, least: float) -> tuple[Floats, Floats]:
    """Returns (N, 2) places across `axis` and (N,) heights of the points between two bounds, from a least height on."""
    first, second = (1 if axis == 0 else 0), (1 if axis == 2 else 2)
    position, height, count = np.empty((len(points), 2)), np.empty(len(points)), 0
    for k in range(len(points)):
        u, v, up = points[k, first], points[k, second], sign * points[k, axis]
        if low[0] <= u <= high[0] and low[1] <= v <= high[1] and up >= least:
            position[count, 0], position[count, 1], height[count] = u, v, up
            count += 1
    return position[:count].copy(), height[:count].copy()


def _start(position: Floats, height: Floats, depth: float) -> tuple[Floats, float]:
    """Returns the place of the farthest point that has companions, and its height."""
    farthest = np.argpartition(-height, min(STRAYS, len(height) - 1))[: STRAYS + 1]
    for first in farthest[np.argsort(-height[farthest], kind="stable")]:
        beside = np.all(np.abs(position - position[first]) < NEAR_MM, axis=1)
        if np.count_nonzero(beside & (height > height[first] - 2 * depth)) > COMPANIONS:
            break
    return position[first], float(height[first])


def _fit(offset: Floats, height: Floats, cap: Cap) -> tuple[Floats, float] | None:
    """Fit a polynomial over a cap; returns (15,) its coefficients and the noise about it, mm.

    None if there are too few points. `offset` are (N, 2) mm from the middle of the cap.
    """
    factors, noise = robust_fit(offset @ cap.spread, np.ascontiguousarray(height), cap.noise, UNEVENNESS * cap.depth)
    return None if noise < 0 else (factors, noise)


@compiled
def _highest(factors: Floats, centre: Floats, spread: Floats, low: Floats, high: Floats) -> tuple[Floats, float]:
    """Returns the place in the cap and in the window where the polynomial is highest, mm, and its height there."""
    back = np.linalg.inv(spread)
    positions = np.minimum(np.maximum(centre + DISC @ back, low), high)
    heights = terms_at((positions - centre) @ spread) @ factors
    at_top = heights >= heights.max() - FLAT_MM  # the middle of a blunt end
    best = np.array([positions[at_top, 0].mean(), positions[at_top, 1].mean()])
    refined = centre + climb(factors, (best - centre) @ spread) @ back
    if np.all((refined > low) & (refined < high)):
        best = refined
    return best, (terms_at(((best - centre) @ spread).reshape(1, 2)) @ factors)[0]


def _cap(factors: Floats, cap: Cap, depth: float, offset: Floats) -> Cap:
    """The cap of the given depth, or deeper if noise requires, by the curvature of the last polynomial."""
    spread, depth = _spread(factors, cap.spread, cap.noise, depth, offset)
    return Cap(spread, depth, cap.noise)


@compiled
def _spread(factors: Floats, last: Floats, noise: float, depth: float, offset: Floats) -> tuple[Floats, float]:
    least, greatest, noisy = RADIUS_MM
    greatest = min(greatest + NOISE_WIDENS * noise, noisy)
    places = offset @ last
    count = max(np.count_nonzero(places[:, 0] ** 2 + places[:, 1] ** 2 < 1.0), 1)
    spacing = np.sqrt(np.pi / abs(np.linalg.det(last)) / count)
    depth = max(depth, NOISES_DEEP * noise * min(spacing, SCARCEST_MM) ** SCARCE_POWER)
    _, second = slope(factors, np.zeros(2))
    curvature, directions = np.linalg.eigh(-(last @ second @ last.T))
    radii = np.sqrt(2 * depth / np.maximum(curvature, 2 * depth / greatest**2))
    radii = np.maximum(radii, min(max(least, SPACINGS * spacing), noisy))
    return (directions / radii) @ directions.T, depth


def saddle(position: Floats, height: Floats, start: Floats, radius: float) -> tuple[Floats, float, Cap] | None:
    """Find where a surface over the plane is level near `start`.

    Parameters
    ----------
    position, height : (N, 2) and (N,) mm
    start : (2,) mm
    radius : mm, of the cap that is fitted

    Returns
    -------
    Place (2,) mm, height in mm and the cap that was fitted; None if there are too few points
    """
    centre, cap = start, Cap(np.eye(2) / radius, radius, LEAST_MISFIT_MM)
    factors = place = np.zeros(0)
    for _ in range(ROUNDS):
        fitted = _fit(position - centre, height, cap)
        if fitted is None:
            return None
        factors, noise = fitted
        cap = cap._replace(noise=noise)
        place = np.zeros(2)
        for _ in range(4):
            gradient, second = slope(factors, place)
            place = np.clip(place - np.linalg.lstsq(second, gradient, rcond=1e-6)[0], -0.5, 0.5)
        centre = centre + place * radius
        if np.all(np.abs(place) * radius < SETTLED_MM):
            break
    return centre, float((terms_at(place[None]) @ factors)[0]), cap


def height_at(position: Floats, height: Floats, place: Floats, radius: float) -> float | None:
    """Height in mm at `place` of a surface over the plane, (N, 2) positions and (N,) heights; None without surface."""
    fitted = _fit(position - place, height, Cap(np.eye(2) / radius, radius, LEAST_MISFIT_MM))
    return None if fitted is None else float(fitted[0][0])


@compiled
def highest_of_each(group: NDArray[np.int64], height: Floats, count: int) -> NDArray[np.int64]:
    """Returns (count,) the number of the highest point in each group, the last of equals; -1 for an empty group.

    Examples
    --------
    >>> highest_of_each(np.array([0, 0, 2]), np.array([1.0, 3.0, 2.0]), count=3).tolist()
    [1, -1, 2]
    """
    highest = np.full(count, -1)
    for k in range(len(group)):
        if highest[group[k]] < 0 or height[k] >= height[highest[group[k]]]:
            highest[group[k]] = k
    return highest

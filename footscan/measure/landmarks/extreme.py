"""Where a surface reaches farthest in a direction: the summit of a polynomial fitted to the vertices around it.

The farthest vertex would not do: on a flat summit it lies anywhere, and noise always puts it too far out. A robust fit
over a cap has neither fault (a smooth foot of 0.3 mm noise: some 0.05 mm).
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
"""A farthest point with fewer others beside it is a stray; there are at most so many."""
NEAR_MM = 6.0
RADIUS_MM = (2.5, 7.5, 16.0)
"""Least half axis of a cap, greatest one without noise, and with noise."""
NOISE_WIDENS = 25.0
"""mm by which the greatest half axis grows with each mm of noise."""
SPACINGS = 2.0
"""A cap reaches at least so many distances of neighbouring points."""
ROUNDS = 6
BORDER_MM = 0.8
"""A summit so near to a bound of its window is one of the window, not of the surface."""
GRID = 23
SETTLED_MM = 0.004
FLAT_MM = 0.01
"""Heights that differ by less are one."""
NOISES_DEEP, SCARCE_POWER, SCARCEST_MM = 5.0, 2 / 3, 2.0
"""A cap is at least so many times the noise deep where points are 1 mm apart, and deeper by this power of their
distance, which counts up to the last: fewer points need a wider cap."""
UNEVENNESS = 0.2
"""Terms of third and fourth order at the border of a cap, in parts of its depth, as expected of a foot: noise may not
make larger ones."""


class Cap(NamedTuple):
    """The part of a surface over which a polynomial was fitted."""

    spread: Floats
    """(2, 2) that takes mm from its middle, across the direction of height, to the unit circle."""
    depth: float
    """By how much its border lies below its middle, mm."""
    noise: float
    """About the polynomial, mm."""

    def held_back(self) -> Floats:
        """(15,) by which the squares of the polynomial's terms are held back against those of the residuals."""
        return held_back(self.noise, UNEVENNESS * self.depth)


class Summit(NamedTuple):
    """The farthest point."""

    point: Point
    """(3,) mm"""
    residual: float
    """Standard deviation of the points of its cap about the fit, mm."""
    at_border: bool
    """Whether the surface goes on rising across a bound of the window."""
    cap: Cap | None = None
    """Which vertices it rests on; None where nothing could be fitted."""


def summit(points: Floats, axis: int, sign: int, window: Window, depth: float) -> Summit | None:
    """The point of a surface that is farthest along `sign` times `axis` within a window.

    Parameters
    ----------
    points : (N, 3) of the surface, mm; those outside the window hold the fit at its border
    axis, sign : 0, 1 or 2 and 1 or -1
    window : bounds along the other two axes, in their order
    depth : of the cap that is fitted, mm

    Returns
    -------
    None where the window holds fewer than three points.
    """
    across = [k for k in range(3) if k != axis]
    low, high = np.array(window, np.float64).T
    first, second = (points[:, k].copy() for k in across)
    height = sign * points[:, axis]
    inside = (first >= low[0]) & (first <= high[0]) & (second >= low[1]) & (second <= high[1])
    if np.count_nonzero(inside) < 3:
        return None
    centre, top = _start(np.column_stack([first[inside], second[inside]]), height[inside], depth)
    near = height > top - 4 * depth - 2.0
    near &= (np.abs(first - centre[0]) < 2 * RADIUS_MM[2]) & (np.abs(second - centre[1]) < 2 * RADIUS_MM[2])
    position, height = np.column_stack([first[near], second[near]]), height[near]
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
        if round_ > 0:  # otherwise caps of two sizes may take turns
            wanted = wanted._replace(spread=(cap.spread + wanted.spread) / 2, depth=(cap.depth + wanted.depth) / 2)
        cap = wanted
    point = np.empty(3)
    point[across], point[axis] = centre, sign * top
    at_border = bool(np.any((centre < low + BORDER_MM) | (centre > high - BORDER_MM)))
    return Summit(point, cap.noise, at_border, fitted_cap)


LINE = np.linspace(-1.0, 1.0, GRID)
DISC = np.array([(u, v) for u in LINE for v in LINE if u * u + v * v <= 1.0])
"""Even places on a cap."""


def _start(position: Floats, height: Floats, depth: float) -> tuple[Floats, float]:
    """The farthest point that has others beside it, and how far it is."""
    farthest = np.argpartition(-height, min(STRAYS, len(height) - 1))[: STRAYS + 1]
    for first in farthest[np.argsort(-height[farthest], kind="stable")]:
        beside = np.all(np.abs(position - position[first]) < NEAR_MM, axis=1)
        if np.count_nonzero(beside & (height > height[first] - 2 * depth)) > COMPANIONS:
            break
    return position[first], float(height[first])


def _fit(offset: Floats, height: Floats, cap: Cap) -> tuple[Floats, float] | None:
    """(15,) factors of the polynomial over a cap, by (N, 2) offsets from its middle, and the noise about it, mm; None
    where there are too few points."""
    factors, noise = robust_fit(offset @ cap.spread, np.ascontiguousarray(height), cap.noise, UNEVENNESS * cap.depth)
    return None if noise < 0 else (factors, noise)


@compiled
def _highest(factors: Floats, centre: Floats, spread: Floats, low: Floats, high: Floats) -> tuple[Floats, float]:
    """Where in the cap and in the window the polynomial is highest, mm, and its height there."""
    back = np.linalg.inv(spread)
    positions = np.minimum(np.maximum(centre + DISC @ back, low), high)
    heights = terms_at((positions - centre) @ spread) @ factors
    at_top = heights >= heights.max() - FLAT_MM  # of a blunt end the middle
    best = np.array([positions[at_top, 0].mean(), positions[at_top, 1].mean()])
    refined = centre + climb(factors, (best - centre) @ spread) @ back
    if np.all((refined > low) & (refined < high)):
        best = refined
    return best, (terms_at(((best - centre) @ spread).reshape(1, 2)) @ factors)[0]


def _cap(factors: Floats, cap: Cap, depth: float, offset: Floats) -> Cap:
    """The cap of `depth`, or deeper against noise, by the curvature of the polynomial over the last one."""
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
    """Where a surface over the plane, (N, 2) positions and (N,) heights, is level near `start`, its height, mm, and the
    cap that both were found by."""
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
    """The height in mm at `place` of a surface over the plane, (N, 2) positions and (N,) heights."""
    fitted = _fit(position - place, height, Cap(np.eye(2) / radius, radius, LEAST_MISFIT_MM))
    return None if fitted is None else float(fitted[0][0])


@compiled
def highest_of_each(group: NDArray[np.int64], height: Floats, count: int) -> NDArray[np.int64]:
    """(count,) which of (N,) points is the highest in each of so many groups, the last of equals; -1 where a group is
    empty."""
    highest = np.full(count, -1)
    for k in range(len(group)):
        if highest[group[k]] < 0 or height[k] >= height[highest[group[k]]]:
            highest[group[k]] = k
    return highest

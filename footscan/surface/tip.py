"""The tip of a surface whose stripes lie in planes that are turned or between each other."""

import numpy as np
from numpy.typing import NDArray

from footscan.robust import MAD_TO_SD, TUKEY

DEPTHS_MM = (4.0, 7.0)
"""The surface is fitted so far from its last point; the second depth where the first holds too little. Chosen by
hand."""
BESIDE_MM = 14.0
"""Half the breadth of the part that is fitted, about the last points: a toe; the tip of the next one lies farther away.
Chosen by hand."""
FEWEST, LEAST_DEPTH_MM = 60, 1.5
"""Points, and their extent along the travel, from which the surface is fitted. Chosen by hand."""
LAST_MM = 0.5
"""Points so near to the last one say where the tip is. Chosen by hand."""
ROUNDS = 6
"""Rounds in which outliers lose their weight."""
LEAST_SPREAD_MM = 0.02
"""Lower bound of the spread, so that exact points have no outliers."""

Floats = NDArray[np.float64]


def tip_beyond(points: Floats, outward: int) -> float | None:
    """Distance along X, mm, of the tip beyond the last of `points` (N, 3), mm; None if they do not show it.

    A quadric is fitted to the end of the surface, robustly: an ellipsoid or paraboloid whose axis may slant.

    Parameters
    ----------
    outward : -1 for the end at the least X, 1 for that at the greatest

    Examples
    --------
    A sphere of radius 10 mm that is seen up to half a millimetre before its tip:

    >>> random = np.random.default_rng(1)
    >>> sphere = random.normal(size=(20_000, 3))
    >>> sphere *= 10.0 / np.linalg.norm(sphere, axis=1, keepdims=True)
    >>> print(round(tip_beyond(sphere[sphere[:, 0] < 9.5], 1), 2))
    0.5
    """
    x = outward * points[:, 0]
    last = float(x.max())
    middle = points[x > last - LAST_MM, 1:].mean(axis=0)
    beside = np.linalg.norm(points[:, 1:] - middle, axis=1) < BESIDE_MM
    for depth in DEPTHS_MM:
        near = beside & (x > last - depth)
        if near.sum() >= FEWEST and np.ptp(x[near]) > LEAST_DEPTH_MM:
            return _tip(x[near] - last, points[near, 1:] - middle)
    return None


def _tip(x: Floats, yz: Floats) -> float | None:
    """X of the tip of the quadric y^2 + a z^2 + b yz + c x^2 + d xy + e xz + f y + g z + h x + k = 0."""
    y, z = yz.T
    rows = np.column_stack([z**2, y * z, x**2, x * y, x * z, y, z, x, np.ones(len(x))])
    weights = np.ones(len(x))
    terms = np.zeros(rows.shape[1])
    for _ in range(ROUNDS):
        terms = np.linalg.lstsq(rows * weights[:, None], -(y**2) * weights, rcond=None)[0]
        a, b, _, d, e, f, g, _, _ = terms
        value = rows @ terms + y**2
        slope = np.hypot(2 * y + b * z + d * x + f, 2 * a * z + b * y + e * x + g)
        distance = value / np.maximum(slope, 1.0)
        spread = max(MAD_TO_SD * float(np.median(np.abs(distance))), LEAST_SPREAD_MM)
        weights = np.clip(1.0 - (distance / (TUKEY * spread)) ** 2, 0.0, None) / np.maximum(slope, 1.0)
    a, b, c, d, e, f, g, h, k = terms
    if 4 * a - b**2 <= 0:
        return None  # no closed section
    # The middle of the section at x is p + q x; the quadric along it is u x^2 + v x + w.
    sections = np.array([[2.0, b], [b, 2 * a]])
    p, q = np.linalg.solve(sections, [-f, -g]), np.linalg.solve(sections, [-d, -e])
    u = c + 0.5 * float(np.array([d, e]) @ q)
    v = h + 0.5 * float(np.array([d, e]) @ p + np.array([f, g]) @ q)
    w = k + 0.5 * float(np.array([f, g]) @ p)
    roots = np.roots([u, v, w])
    beyond = [float(root.real) for root in roots if abs(root.imag) < 1e-9 and root.real > -LAST_MM]
    return min(beyond) if beyond else None

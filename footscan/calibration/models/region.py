"""The region of the image that data support."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from footscan.compiled import compiled
from schemas.base.units import Point

LEAST_WIDTH_PX = 0.1
"""Width below which a region is a line."""
ROUNDING = 1e-9
"""Margin, relative to the size of a region, by which its own corners lie inside."""


def region_of(pixels: NDArray[np.float64]) -> list[Point]:
    """Compute the corners of the convex hull of `pixels` (N, 2), px; empty if they lie about on a line.

    >>> region_of(np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0], [2.0, 1.0]]))
    [(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (0.0, 2.0)]
    """
    if len(pixels) < 3:
        return []
    try:
        hull = ConvexHull(pixels)
    except QhullError:
        return []
    if 2.0 * hull.volume < LEAST_WIDTH_PX * hull.area:  # in the plane: area and perimeter
        return []
    corners = pixels[hull.vertices]
    first = int(np.lexsort(corners.T[::-1])[0])  # the same corners in the same order, whatever the order of pixels
    return [(float(i), float(j)) for i, j in np.roll(corners, -first, axis=0)]


def supported(region: list[Point], pixels: NDArray[np.floating], margin_px: float = 0.0) -> NDArray[np.bool_]:
    """Select the pixels that lie in a convex region, or at most `margin_px` outside its sides.

    Parameters
    ----------
    region : corners in either direction of rotation; empty for an unknown region, which supports every pixel.
    pixels : (N, 2), px, image frame.

    Returns
    -------
    (N,) bool.

    Examples
    --------
    >>> square = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]
    >>> print(supported(square, np.array([[2.0, 2.0], [5.0, 2.0], [9.0, 2.0]]), margin_px=1.0))
    [ True  True False]
    """
    if not region:
        return np.ones(len(pixels), np.bool_)
    corners = np.array(region, np.float64)
    sides = np.roll(corners, -1, axis=0) - corners
    sides, corners = sides[np.any(sides != 0, axis=1)], corners[np.any(sides != 0, axis=1)]
    doubled_area = np.sum(corners[:, 0] * np.roll(corners[:, 1], -1) - np.roll(corners[:, 0], -1) * corners[:, 1])
    # Inward unit normals, for either direction of rotation of the corners.
    inward = np.sign(doubled_area) * np.stack([-sides[:, 1], sides[:, 0]], axis=1)
    inward /= np.hypot(sides[:, 0], sides[:, 1])[:, np.newaxis]
    offsets = np.sum(inward * corners, axis=1)
    rounding = ROUNDING * (1.0 + np.abs(corners).max(initial=0.0))
    inside: NDArray[np.bool_] = _inside(np.asarray(pixels, np.float64), inward, offsets - margin_px - rounding)
    return inside


@compiled
def _inside(
    pixels: NDArray[np.float64], inward: NDArray[np.float64], offsets: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """True for pixels (N, 2) on the inner side of all lines inward . (i, j) = offset, (K, 2) and (K,)."""
    inside = np.ones(pixels.shape[0], np.bool_)
    for n in range(pixels.shape[0]):
        for k in range(offsets.shape[0]):
            # Negated, so that a pixel of NaN lies outside.
            if not inward[k, 0] * pixels[n, 0] + inward[k, 1] * pixels[n, 1] >= offsets[k]:
                inside[n] = False
                break
    return inside

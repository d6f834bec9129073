"""The landing point: the middle of the heel's contact with the floor."""

import numpy as np
from numpy.typing import NDArray

from footscan.measure.landmarks.extreme import Floats, Point

CONTACT_MM = 1.0
"""Up to this height above the floor the sole counts as touching it."""
HEEL = (0.05, 0.25)
"""Shares of the length between which the contact is taken; chosen by hand."""
LEAST_AREA_MM2 = 60.0
"""A heel with less contact does not stand on the floor; chosen by hand."""


def landing_point(vertices: Floats, faces: NDArray[np.integer], length: float) -> Point | None:
    """Find the middle of the heel's contact with the floor; None if the heel does not stand on it.

    The contact is the section of the foot at `CONTACT_MM` between two lines across the axis. Its centroid follows from
    Green's theorem: the two lines run along Y and add nothing to integrals over dX.

    Parameters
    ----------
    vertices : (V, 3) mm, foot frame
    faces : (F, 3), looking outward
    length : mm, foot length

    Examples
    --------
    A box from the floor up, 100 mm long and 60 mm broad, for a foot of 200 mm: its contact runs from X = 10 to 50.

    >>> x, y, z = np.meshgrid([0.0, 100.0], [-30.0, 30.0], [0.0, 50.0], indexing="ij")
    >>> box = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    >>> sides = [[0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5]]
    >>> bool(np.allclose(landing_point(box, np.array(sides), length=200.0), [30, 0, 0]))
    True
    """
    start, end = _outline(vertices, faces)
    first, last = HEEL[0] * length, HEEL[1] * length
    along = end[:, 0] - start[:, 0]
    kept = np.abs(along) > 1e-12
    start, end, along = start[kept], end[kept], along[kept]
    shares = np.sort(np.clip((np.array([[first], [last]]) - start[:, 0]) / along, 0.0, 1.0), axis=0)
    (x0, y0), (x1, y1) = ((start + share[:, None] * (end - start)).T for share in shares)
    dx = x1 - x0
    area = -float(np.sum(dx * (y0 + y1))) / 2
    if area < LEAST_AREA_MM2:
        return None
    x = -float(np.sum(dx * (2 * x0 * y0 + 2 * x1 * y1 + x0 * y1 + x1 * y0))) / 6 / area
    y = -float(np.sum(dx * (y0 * y0 + y0 * y1 + y1 * y1))) / 6 / area
    return np.array([x, y, 0.0])


def _outline(vertices: Floats, faces: NDArray[np.integer]) -> tuple[Floats, Floats]:
    """Returns (S, 2) starts and (S, 2) ends of the pieces of the section, the foot on their left."""
    height = vertices[:, 2] - CONTACT_MM
    above = height >= 0
    count = above[faces].sum(axis=1)
    crossed = faces[(count == 1) | (count == 2)]
    following = np.roll(crossed, -1, axis=1)
    rising = ~above[crossed] & above[following]
    falling = above[crossed] & ~above[following]
    ends = []
    for edge in (falling, rising):
        low, high = crossed[edge], following[edge]
        share = height[low] / (height[low] - height[high])
        ends.append(vertices[low, :2] + share[:, None] * (vertices[high, :2] - vertices[low, :2]))
    return ends[0], ends[1]

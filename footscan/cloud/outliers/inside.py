"""Points inside the foot, at its ends: stripes of another laser that were placed behind the skin.

The skin of a heel is steep, so a stripe of another laser is displaced by millimetres there, and few cameras see the
place. Skin lies around the sections of the foot. What lies amid the skin that other cameras see there, or see nearer to
the end, is none.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.cloud.points import PLANE_MM, camera_numbers, coordinates
from footscan.compiled import compiled
from footscan.side_by_side import together

END_MM = 8.0
"""Part of the foot at each end that is judged. Chosen by hand."""
OUTERMOST = 10
"""Points beyond an end that count as strays. Chosen by hand."""
SIDES, FEWEST = 8, 3
"""Sectors around a point, and points that each of them must have. Chosen by hand."""
INSIDE_MM, AROUND_MM = 2.0, 30.0
"""Distances of those points from it across the travel. Chosen by hand."""
APART_MM, NEAR_MM = 2.5, 1.5
"""Sections with a larger gap in Y than the first are of several toes, between which there is skin. So is what lies
nearer to others than the second: in a narrower cleft. Chosen by hand."""


def is_inside(points: NDArray[np.void]) -> NDArray[np.bool_]:
    """Select the points (N,) of `POINT_DTYPE`, mm, amid the skin that other cameras see at an end of the foot.

    A stripe in the middle of the cap of a sphere:

    >>> from footscan.cloud.points import make_points
    >>> angles = np.linspace(0, 2 * np.pi, 60)
    >>> ring = np.column_stack([np.cos(angles), np.sin(angles)])
    >>> skin = np.concatenate([np.insert(np.sqrt(60 * x - x**2) * ring, 0, x, axis=1) for x in (1.0, 2.0, 3.0)])
    >>> stripe = np.column_stack([np.full(9, 3.0), np.linspace(-2, 2, 9), np.zeros(9)])
    >>> camera = np.repeat([1, 2], [len(skin), len(stripe)])
    >>> selected = is_inside(make_points(np.concatenate([skin, stripe]), camera=camera))
    >>> int(selected[: len(skin)].sum()), int(selected[len(skin) :].sum())
    (0, 9)
    """
    selected = np.zeros(len(points), np.bool_)
    if len(points) <= 2 * OUTERMOST:
        return selected
    xyz, camera = coordinates(points), camera_numbers(points)

    def of_stripe(stripe: NDArray[np.intp], near: NDArray[np.intp], depth: NDArray[np.float64]) -> NDArray[np.intp]:
        beyond = near[depth[near] > depth[stripe].min() - PLANE_MM]
        others = xyz[beyond[camera[beyond] != camera[stripe[0]]]]
        if len(others) < SIDES * FEWEST or np.diff(np.sort(others[:, 1])).max() >= APART_MM:
            return stripe[:0]
        amid = _is_amid(xyz[stripe, 1:].copy(), others[:, 1:].copy())
        return stripe[amid & ~_is_near(xyz[stripe], others)]

    for outward in (-1.0, 1.0):
        depth = np.sort(-outward * xyz[:, 0])[OUTERMOST - 1] + outward * xyz[:, 0]
        near = np.flatnonzero(depth > -END_MM)
        for inside in together(partial(of_stripe, stripe, near, depth) for stripe in _stripes(points, near)):
            selected[inside] = True
    return selected


def _stripes(points: NDArray[np.void], near: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """The points `near` of each camera in each frame."""
    order = near[np.lexsort([points["frame"][near], points["camera"][near]])]
    new = (np.diff(points["frame"][order]) != 0) | (np.diff(points["camera"][order].astype(np.int64)) != 0)
    yield from (stripe for stripe in np.split(order, np.flatnonzero(new) + 1) if len(stripe))


def _is_near(places: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Select the places (N, 3) that are near to others (M, 3), mm."""
    return np.isfinite(KDTree(others).query(places, distance_upper_bound=NEAR_MM)[0])


@compiled
def _is_amid(places: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Select the places (N, 2) that have others (M, 2) on all sides; Y and Z, mm."""
    amid = np.zeros(len(places), np.bool_)
    of_sides = np.zeros(SIDES, np.int64)
    for n in range(len(places)):
        of_sides[:] = 0
        for m in range(len(others)):
            y, z = others[m, 0] - places[n, 0], others[m, 1] - places[n, 1]
            if INSIDE_MM**2 < y * y + z * z < AROUND_MM**2:
                of_sides[int((np.arctan2(z, y) / (2 * np.pi) + 0.5) * SIDES) % SIDES] += 1
        amid[n] = of_sides.min() >= FEWEST
    return amid

"""How far the laser planes of the heads lie apart: where they are close, cameras see two stripes as one."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.calibration.models.laser_plane import MIDDLE_Z_MM, terms_of_plane
from footscan.cloud.points import coordinates
from footscan.cloud.views import View
from footscan.side_by_side import cores

Floats = NDArray[np.float64]

HALF_MM = 50.0
"""Half the breadth of the volume of a foot."""
UNKNOWN = np.empty((0, 6))
"""Planes of which no film or scan has shown where they lie."""


def lasers_of(views: Mapping[int, View]) -> Floats:
    """(L, 6) for each laser the number of its head, and how far its plane is ahead of the travel, mm: the factors of
    the first five `terms_of_plane` with their X counted from 0; `UNKNOWN` if a view has no plane.

    >>> from schemas.calibration import LaserPlane
    >>> plane = LaserPlane(head=2, offset_mm=0.5, yaw=0.01, sd=[0.0] * 7)
    >>> lasers_of({4: View(np.zeros(3), np.empty((0, 2)), plane)}).tolist()
    [[2.0, 0.5, 0.01, 0.0, 0.0, 0.0]]
    """
    found = {}
    for view in views.values():
        plane = view.plane
        if plane is None:
            return UNKNOWN
        constant = view.ahead_mm + plane.offset_mm + plane.scale * (view.ahead_mm - plane.x_mm)
        terms = [plane.head, constant, plane.yaw, plane.pitch, plane.bend_mm, plane.scale]
        found[plane.head, view.ahead_mm] = terms
    return np.array([found[laser] for laser in sorted(found)]) if found else UNKNOWN


def planes_apart(planes: Floats, x_mm: tuple[float, float]) -> float:
    """Largest distance along X between two planes (L, 6) over the volume of a foot, mm; infinite if they are `UNKNOWN`.

    x_mm : least and greatest X of the foot

    >>> planes_apart(np.array([[1, 0.5, 0, 0, 0, 0], [2, -0.25, 0, 0, 0, 0]]), (0.0, 250.0))
    0.75
    """
    if not len(planes):
        return np.inf
    corners = [(x, y, z) for x in x_mm for y in (-HALF_MM, HALF_MM) for z in (0.0, 2 * MIDDLE_Z_MM)]
    return float(np.ptp(_ahead(planes, np.array(corners)), axis=0).max())


def between_lasers(
    planes: Floats, places: Floats, cloud: NDArray[np.void], head_of: Mapping[int, int], lit_mm: Floats | float
) -> NDArray[np.float64]:
    """(V,) least distance along X between two of the `planes` (L, 6) whose lasers light a place, mm; infinite where at
    most one does.

    Parameters
    ----------
    places : (V, 3) mm
    cloud : (N,) of `POINT_DTYPE`
    head_of : camera of the cloud -> number of its head
    lit_mm : (V,) or one for all: a laser lights a place if points of its head are nearer than this
    """
    lit = {}
    for head in set(planes[:, 0]):
        own = np.isin(cloud["camera"], [camera for camera, of_camera in head_of.items() if of_camera == head])
        near = KDTree(coordinates(cloud[own])).query(places, distance_upper_bound=np.max(lit_mm), workers=cores())
        lit[head] = near[0] < lit_mm
    least = np.full(len(places), np.inf)
    lasers = zip(planes[:, 0], _ahead(planes, places), strict=True)
    for (one, one_ahead), (other, other_ahead) in combinations(lasers, 2):
        apart = np.where(lit[one] & lit[other], np.abs(one_ahead - other_ahead), np.inf)
        least = np.minimum(least, apart)
    return least


def _ahead(planes: Floats, places: Floats) -> Floats:
    """(L, V) how far the planes are ahead of the travel at `places` (V, 3), mm."""
    still = np.zeros(len(places))
    terms = terms_of_plane(places[:, 0], places[:, 1:], still, still, 0.0)
    return np.asarray(planes[:, 1:] @ terms[:, :5].T)

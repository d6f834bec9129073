"""How far the laser planes of the heads lie apart: where they are close, cameras see two stripes as one."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.calibration.models.laser_plane import BEND_MM, MIDDLE_Z_MM
from footscan.cloud.points import coordinates
from footscan.cloud.views import View

Floats = NDArray[np.float64]

HALF_MM = 50.0
"""Half the breadth of the volume of a foot."""
LIT_MM = 6.0
"""A laser lights the skin around the points of its head up to this distance. Chosen by hand."""
UNKNOWN = np.empty((0, 6))
"""Planes of which no film or scan has shown where they lie."""


def head_planes(views: Mapping[int, View]) -> Floats:
    """(H, 6) for each head its number, and how far its laser plane is ahead of the travel, mm: constant, and for each
    mm of Y, of Z - `MIDDLE_Z_MM`, of the bend by (Y / `BEND_MM`)², and of X; `UNKNOWN` if a view has no plane.

    >>> from schemas.calibration import LaserPlane
    >>> plane = LaserPlane(head=2, offset_mm=0.5, yaw=0.01, sd=[0.0] * 7)
    >>> head_planes({4: View(np.zeros(3), np.empty((0, 2)), plane)}).tolist()
    [[2.0, 0.5, 0.01, 0.0, 0.0, 0.0]]
    """
    found = {}
    for view in views.values():
        plane = view.plane
        if plane is None:
            return UNKNOWN
        constant = view.ahead_mm + plane.offset_mm + plane.scale * (view.ahead_mm - plane.x_mm)
        found[plane.head] = [plane.head, constant, plane.yaw, plane.pitch, plane.bend_mm, plane.scale]
    return np.array([found[head] for head in sorted(found)]) if found else UNKNOWN


def planes_apart(planes: Floats, x_mm: tuple[float, float]) -> float:
    """Largest distance along X between two planes (H, 6) over the volume of a foot, mm; infinite if they are `UNKNOWN`.

    x_mm : least and greatest X of the foot

    >>> planes_apart(np.array([[1, 0.5, 0, 0, 0, 0], [2, -0.25, 0, 0, 0, 0]]), (0.0, 250.0))
    0.75
    """
    if not len(planes):
        return np.inf
    corners = [(x, y, z) for x in x_mm for y in (-HALF_MM, HALF_MM) for z in (0.0, 2 * MIDDLE_Z_MM)]
    return float(np.ptp(_ahead(planes, np.array(corners)), axis=0).max())


def between_lasers(
    planes: Floats, places: Floats, cloud: NDArray[np.void], head_of: Mapping[int, int]
) -> NDArray[np.float64]:
    """(V,) least distance along X between two of the `planes` (H, 6) whose lasers light a place, mm; infinite where at
    most one does.

    Parameters
    ----------
    places : (V, 3) mm
    cloud : (N,) of `POINT_DTYPE`
    head_of : camera of the cloud -> number of its head
    """
    least = np.full(len(places), np.inf)
    head = np.array([head_of.get(camera, 0) for camera in range(256)])[cloud["camera"]]
    ahead, lit = _ahead(planes, places), []
    for number in planes[:, 0].astype(int):
        own = coordinates(cloud[head == number])
        far = np.full(len(places), np.inf) if not len(own) else np.asarray(KDTree(own).query(places)[0])
        lit.append(far <= LIT_MM)
    for one in range(len(planes)):
        for other in range(one):
            apart = np.where(lit[one] & lit[other], np.abs(ahead[one] - ahead[other]), np.inf)
            least = np.minimum(least, apart)
    return least


def _ahead(planes: Floats, places: Floats) -> Floats:
    """(H, V) how far the planes are ahead of the travel at `places` (V, 3), mm."""
    x, y, z = places.T
    return np.asarray(planes[:, 1:] @ np.array([np.ones(len(x)), y, z - MIDDLE_Z_MM, (y / BEND_MM) ** 2, x]))

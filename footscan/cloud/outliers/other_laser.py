"""Points of another head's laser: where two laser planes are millimetres apart, a camera sees two stripes on one skin.

The stripe of the other head is mapped as if it lay in the plane of the camera's own head, which displaces it. In the
plane in which it lies, the cameras of the other head have seen it too.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.calibration.models.laser_plane import x_in_plane
from footscan.cloud.points import coordinates
from footscan.cloud.views import View

Floats = NDArray[np.float64]

LEAST_MM = 0.25
"""Distance in X between two planes from which a stripe of the other one is displaced more than by noise. Chosen by
hand."""
CONFIRMED_MM = 0.4
"""A camera sees a place if it has a point this near; stripes are sampled every 0.3 mm. Chosen by hand."""
CLOSE = 0.3
"""A point is of another laser if it is brought this near, in units of the way that it is moved, to what the cameras of
that head saw. A point of its own laser is moved off the skin, except where the camera looks along it. Chosen by
hand."""


def is_of_other_laser(points: NDArray[np.void], views: Mapping[int, View]) -> NDArray[np.bool_]:
    """Select the points (N,) of `POINT_DTYPE` that are stripes of another head's laser.

    Cameras whose calibration does not say where their laser plane lies are left as they are.
    """
    strange = np.zeros(len(points), np.bool_)
    heads: dict[int, list[int]] = {}
    for camera, view in views.items():
        if view.plane is not None:
            heads.setdefault(view.plane.head, []).append(camera)
    if len(heads) < 2:
        return strange
    xyz = coordinates(points)
    of_camera = {camera: np.flatnonzero(points["camera"] == camera) for cameras in heads.values() for camera in cameras}
    of_head = {head: _tree(xyz, [of_camera[camera] for camera in cameras]) for head, cameras in heads.items()}
    for head, cameras in heads.items():
        for camera in cameras:
            own = of_camera[camera]
            if not len(own):
                continue
            for other_head in heads:
                if other_head != head:
                    moved, apart = _in_other_plane(points[own], views[camera], views[heads[other_head][0]])
                    there = _distances(of_head[other_head], moved)
                    way = np.linalg.norm(moved - xyz[own], axis=1)
                    strange[own] |= (there < np.minimum(CONFIRMED_MM, CLOSE * way)) & (apart > LEAST_MM)
    return strange


def _in_other_plane(points: NDArray[np.void], view: View, other: View) -> tuple[Floats, Floats]:
    """Where points (N,) lie if they were seen in the plane of another head, (N, 3) mm, and how far the planes are
    apart there, (N,) mm."""
    assert view.plane is not None
    assert other.plane is not None
    xyz, x = coordinates(points), points["plane"].astype(np.float64)
    nothing = np.zeros(len(points))
    there, here = (x_in_plane(plane, x, xyz[:, 1:], nothing, nothing) for plane in (other.plane, view.plane))
    apart = there - here
    sight = view.centre - np.column_stack([nothing, xyz[:, 1:]])
    return xyz + (apart / sight[:, 0])[:, None] * sight, np.abs(apart)


def _tree(xyz: Floats, parts: list[NDArray[np.intp]]) -> KDTree | None:
    rows = np.concatenate([np.empty(0, np.intp), *parts])
    return KDTree(xyz[rows]) if len(rows) else None


def _distances(tree: KDTree | None, places: Floats) -> Floats:
    """Distances (N,) of the nearest points of a tree, mm; infinite beyond those that matter."""
    if tree is None:
        return np.full(len(places), np.inf)
    finite = np.isfinite(places).all(axis=1)
    distance = np.full(len(places), np.inf)
    distance[finite] = tree.query(places[finite], distance_upper_bound=CONFIRMED_MM)[0]
    return distance

"""When each point was seen: cameras film at their own moments, and rows of a picture one after the other.

Cameras are not synchronised: frames with one number may lie up to a frame apart, in which the heads travel on. Heads
that run together are at one place at one moment, so frames are told by the place of the heads.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.calibration.models.laser_plane import x_in_turned_plane
from footscan.cloud.points import coordinates, copied, stripe_step
from footscan.cloud.views import View

Floats = NDArray[np.float64]

MOST_STEPS = 5.0
"""Cameras may begin with another frame: heads that are farther apart in frames of one number, in steps of the travel,
do not run together. Chosen by hand."""
LEAST_MM = 0.01
"""Travel within a frame below which all its rows count as of one moment. Chosen by hand."""
MOST_SLOPE = 10.0
"""Bound of the way that a stripe moves across the skin, in mm per mm of travel. Chosen by hand."""


def renumbered(points: NDArray[np.void], views: Mapping[int, View]) -> NDArray[np.void]:
    """Number the frames so that those of all cameras in which the heads are about at one place have one number.

    Frames of heads that do not run together keep their numbers.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, of cameras that have views

    Examples
    --------
    The second camera began two frames later, and films half a step ahead of the first one:

    >>> from footscan.cloud.points import make_points
    >>> places = [np.column_stack([2.0 * np.arange(9) + ahead, np.zeros((9, 2))]) for ahead in (0.0, 4.8)]
    >>> points = [make_points(xyz, camera + 1, np.arange(9)) for camera, xyz in enumerate(places)]
    >>> views = {camera: View(np.zeros(3), np.empty((0, 2))) for camera in (1, 2)}
    >>> renumbered(np.concatenate(points), views)["frame"][[0, 9]].tolist()
    [0, 2]
    """
    step = stripe_step(points)
    if not len(points) or step <= 0:
        return points
    x = travel_of(points, views)
    places = [_by_frame(points["frame"], x, points["camera"] == number) for number in np.unique(points["camera"])]
    reference = max(places, key=len)
    shifts = []
    for of_camera in places:
        apart = np.array([of_camera[frame] - reference[frame] for frame in of_camera.keys() & reference.keys()])
        middle = float(np.median(apart)) if len(apart) else np.inf
        if len(apart) == 0 or np.median(np.abs(apart - middle)) > step / 2 or abs(middle) > MOST_STEPS * step:
            return points
        shifts.append(round(middle / step))
    moved, cameras = copied(points), np.unique(points["camera"])
    moved["frame"] += np.array(shifts, np.int32)[np.searchsorted(cameras, points["camera"])] - min(shifts)
    return moved


def ahead_of_frames(points: NDArray[np.void], views: Mapping[int, View]) -> Floats | None:
    """By how much the head of each point (N,) was ahead of the mean of its frame, mm; None if the heads do not run
    together, and are at different places at one moment.

    points : (N,) of `POINT_DTYPE`, of `renumbered`
    """
    x, frame = travel_of(points, views), points["frame"] - points["frame"].min()
    ahead = x - (np.bincount(frame, x) / np.maximum(np.bincount(frame), 1))[frame]
    return ahead if np.median(np.abs(ahead)) <= stripe_step(points) / 2 else None


def travel_of(points: NDArray[np.void], views: Mapping[int, View]) -> Floats:
    """X of the head of each point (N,) by the travel, mm, when its frame was taken."""
    x = points["plane"].astype(np.float64)
    for number, view in views.items():
        rows = points["camera"] == number
        plane = view.plane
        if plane is not None:  # the reverse of `plane_of_travel`
            x[rows] = (x[rows] - plane.offset_mm + plane.scale * plane.x_mm) / (1.0 + plane.scale)
        x[rows] -= view.ahead_mm
    return x


def plane_of_travel(view: View, x: Floats) -> Floats:
    """X of the middle of the laser plane (N,) with its head at x (N,) by the travel, mm."""
    plane = view.plane
    if plane is None:
        return x + view.ahead_mm
    return np.asarray(x + view.ahead_mm + plane.offset_mm + plane.scale * (x + view.ahead_mm - plane.x_mm))


def late_rows(points: NDArray[np.void], views: Mapping[int, View]) -> Floats:
    """How far the head had travelled when the row of each point was exposed, (N,) mm, from when its frame counts."""
    late = np.zeros(len(points))
    for number, view in views.items():
        rows = np.flatnonzero(points["camera"] == number)
        if view.plane is not None:
            xyz, x = coordinates(points[rows]), points["plane"][rows].astype(np.float64)
            late[rows] = xyz[:, 0] - x_in_turned_plane(view.plane, x, xyz[:, 1:])
    return late


def motion(points: NDArray[np.void], late: Floats) -> Floats:
    """The way in Y and Z (N, 2) that the stripe at each point moves across the skin per mm of travel, if rows are late.

    It leads to the nearest points of the same camera in the frames before and behind.
    """
    way_per_mm = np.zeros((len(points), 2))
    step = stripe_step(points)
    if np.ptp(late) < LEAST_MM or not step:
        return way_per_mm
    yz, frame = coordinates(points)[:, 1:], points["frame"].astype(np.float64)
    reach = MOST_SLOPE * step
    for number in np.unique(points["camera"]):
        rows = np.flatnonzero(points["camera"] == number)
        apart = 3.0 * reach + np.ptp(yz[rows])  # frames lie so far apart in the tree that they are not near each other
        tree = KDTree(np.column_stack([apart * frame[rows], yz[rows]]))
        found = np.zeros(len(rows))
        for way in (-1.0, 1.0):
            moved = np.column_stack([apart * (frame[rows] + way), yz[rows]])
            near = np.asarray(tree.query(moved, distance_upper_bound=reach)[1])
            known = near < len(rows)
            way_per_mm[rows[known]] += way * (yz[rows][near[known]] - yz[rows[known]]) / step
            found += known
        way_per_mm[rows] /= np.maximum(found, 1.0)[:, None]
    return way_per_mm


def of_any_laser(points: NDArray[np.void], views: Mapping[int, View]) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """The points (N,) with the greatest X that the lasers of all heads give them, and with the least one.

    None are given where it is not known how the planes lie, as with heads that travel one after the other.
    """
    views = {number: view for number, view in views.items() if view.plane is not None}
    points = points.compress(np.isin(points["camera"], list(views)))
    if not len(points) or ahead_of_frames(renumbered(points, views), views) is None:
        return points[:0], points[:0]
    travel, yz = travel_of(points, views), coordinates(points)[:, 1:]
    planes = [(view.plane, plane_of_travel(view, travel)) for view in views.values()]
    x = np.array([x_in_turned_plane(plane, middle, yz) for plane, middle in planes if plane is not None])
    greatest, least = copied(points), copied(points)
    greatest["x"], least["x"] = x.max(axis=0), x.min(axis=0)
    return greatest, least


def _by_frame(frame: NDArray[np.integer], x: Floats, rows: NDArray[np.bool_]) -> dict[int, float]:
    """Frame -> X, of the points selected."""
    frames, first = np.unique(frame[rows], return_index=True)
    return dict(zip(frames.tolist(), x[rows][first].tolist(), strict=True))

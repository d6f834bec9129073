"""World points, of which clouds are made."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from schemas.scan import MOST_CAMERA

PLANE_MM = 0.25
"""Distance in X up to which stripe planes count as one plane. Chosen by hand."""

UNKNOWN_SIGMA_MM = 0.1
"""Standard deviation assumed for points without one. Chosen by hand."""

POINT_DTYPE = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("plane", "<f4"),
        ("source", "<i4"),
        ("frame", "<i4"),
        ("camera", "u1"),
        ("supported", "?"),
        ("sigma", "<f4"),
        ("cameras", "u1"),
    ]
)
"""A world point.

x, y, z : mm, scanner frame
plane : X of its laser plane, mm: that of all points of a stripe, even if the plane is turned
source : row of the stripe point that it was mapped from
frame : number of that point's frame
camera : number of the camera, or of its view as in `schemas.calibration.view_number` until the cloud has normals
supported : True if the calibration supports its pixel
sigma : expected standard deviation of its place, mm, along the normal of the surface within the laser plane
cameras : number of cameras whose points were averaged to it

Coordinates are stored as float32: at half a metre their last digit is 0.03 µm, a thousandth of what a stripe resolves.
Arithmetic on them is done in float64, see `coordinates`.

NumPy copies structures field by field, but not where it takes whole items: `take` and `compress` are ten to forty times
as fast as indices and masks in brackets, and so are `copied` and `joined` beside `copy` and `concatenate`.
"""
_WHOLE = np.dtype((np.void, POINT_DTYPE.itemsize))
"""A point as bytes."""


def make_points(
    xyz: NDArray[np.floating],
    camera: int | NDArray[np.integer],
    frame: int | NDArray[np.integer] = 0,
    source: int | NDArray[np.integer] = 0,
    supported: bool | NDArray[np.bool_] = True,
    sigma: float | NDArray[np.floating] = UNKNOWN_SIGMA_MM,
    plane: NDArray[np.floating] | None = None,
) -> NDArray[np.void]:
    """Build points from coordinates; the other fields are one value for all points or (N,) values.

    Parameters
    ----------
    xyz : (N, 3), mm, scanner frame.
    sigma : mm.
    plane : mm; default: the X of each point.

    Returns
    -------
    (N,) of `POINT_DTYPE`, each seen by one camera.

    Examples
    --------
    >>> points = make_points(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), camera=2, frame=np.array([7, 8]))
    >>> points["z"].tolist(), points["camera"].tolist(), points["frame"].tolist()
    ([3.0, 6.0], [2, 2], [7, 8])
    """
    points = np.zeros(len(xyz), POINT_DTYPE)
    points["x"], points["y"], points["z"] = np.asarray(xyz).T
    points["camera"], points["frame"], points["source"], points["supported"] = camera, frame, source, supported
    points["sigma"], points["cameras"] = sigma, 1
    points["plane"] = points["x"] if plane is None else plane
    return points


def copied(points: NDArray[np.void]) -> NDArray[np.void]:
    """A copy of `points`.

    >>> copied(make_points(np.array([[1.0, 2.0, 3.0]]), camera=2))["z"].tolist()
    [3.0]
    """
    return points.view(_WHOLE).copy().view(POINT_DTYPE)


def joined(parts: Iterable[NDArray[np.void]]) -> NDArray[np.void]:
    """The points of all `parts`, in their order; none without parts.

    >>> joined([make_points(np.array([[1.0, 2.0, z]]), camera=2) for z in (3.0, 4.0)])["z"].tolist(), len(joined([]))
    ([3.0, 4.0], 0)
    """
    return np.concatenate([np.empty(0, _WHOLE), *(part.view(_WHOLE) for part in parts)]).view(POINT_DTYPE)


def stripe_step(points: NDArray[np.void]) -> float:
    """The distance from one stripe plane to the next along the travel, mm; the median over frames and cameras.

    Each camera is measured separately, since the planes of different cameras may lie between each other. The distance
    is 0 if no camera has two planes.

    >>> stripe_step(make_points(np.array([[0.0, 0, 0], [1.5, 0, 0], [3.0, 0, 0]]), camera=1, frame=np.arange(3)))
    1.5
    """
    frame = points["frame"] - points["frame"].min(initial=0)
    frames = int(frame.max(initial=0)) + 1
    group = points["camera"].astype(np.intp) * frames + frame
    counts = np.bincount(group)
    groups = np.flatnonzero(counts)
    planes = np.bincount(group, points["plane"])[groups] / counts[groups]
    steps = np.abs(np.diff(planes))[np.diff(groups // frames) == 0]
    return float(np.median(steps)) if len(steps) else 0.0


def camera_numbers(points: NDArray[np.void]) -> NDArray[np.int64]:
    """(N,) numbers of the cameras of `points`, of whichever of their views.

    >>> camera_numbers(make_points(np.zeros((2, 3)), camera=np.array([5, 69]))).tolist()
    [5, 5]
    """
    return np.asarray((points["camera"].astype(np.int64) - 1) % MOST_CAMERA + 1)


def of_cameras(points: NDArray[np.void]) -> NDArray[np.void]:
    """A copy of `points` with the numbers of their cameras instead of those of views."""
    numbered = copied(points)
    numbered["camera"] = camera_numbers(points)
    return numbered


def coordinates(points: NDArray[np.void]) -> NDArray[np.float64]:
    """(N, 3) float64, X, Y, Z of `points`, mm, scanner frame."""
    return np.column_stack([points[axis].astype(np.float64) for axis in "xyz"])

"""World points: what a stripe point becomes, and what clouds are made of."""

import numpy as np
from numpy.typing import NDArray

PLANE_MM = 0.25
"""Stripe planes closer than this are one."""

UNKNOWN_SIGMA_MM = 0.1
"""Standard deviation of points that nothing is known of."""

POINT_DTYPE = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("source", "<i4"),
        ("frame", "<i4"),
        ("camera", "u1"),
        ("supported", "?"),
        ("sigma", "<f4"),
        ("cameras", "u1"),
    ]
)
"""A world point: x, y, z in mm (scanner frame), the row of the stripe point it came from, its frame, its camera,
whether the calibration supports its pixel, the standard deviation to be expected of its place in mm, along the normal
of the surface within the laser's plane, and how many cameras it was made of.

Coordinates are stored as float32: half a metre away their last digit is 0.03 µm, a thousandth of what a stripe
resolves. Arithmetic on them is done in float64, see `coordinates`.
"""


def make_points(
    xyz: NDArray[np.floating],
    camera: int | NDArray[np.integer],
    frame: int | NDArray[np.integer] = 0,
    source: int | NDArray[np.integer] = 0,
    supported: bool | NDArray[np.bool_] = True,
    sigma: float | NDArray[np.floating] = UNKNOWN_SIGMA_MM,
) -> NDArray[np.void]:
    """A (N,) array of `POINT_DTYPE` from (N, 3) coordinates in mm and, each, one value or N of them."""
    points = np.zeros(len(xyz), POINT_DTYPE)
    points["x"], points["y"], points["z"] = np.asarray(xyz).T
    points["camera"], points["frame"], points["source"], points["supported"] = camera, frame, source, supported
    points["sigma"], points["cameras"] = sigma, 1
    return points


def stripe_step(points: NDArray[np.void]) -> float:
    """Distance in mm from one stripe plane to the next, as a camera travels; the median over frames and cameras.

    Cameras are looked at one by one, for their planes may lie between each other's. 0 where no camera has two planes.
    """
    steps = [
        _frame_steps(points["frame"][points["camera"] == camera], points["x"][points["camera"] == camera])
        for camera in np.unique(points["camera"])
    ]
    return float(np.median(np.concatenate(steps))) if any(len(step) for step in steps) else 0.0


def _frame_steps(frame: NDArray[np.int32], x: NDArray[np.float32]) -> NDArray[np.float64]:
    """Ways in mm from each frame of one camera to its next one that holds points."""
    _, number, counts = np.unique(frame, return_inverse=True, return_counts=True)
    return np.abs(np.diff(np.bincount(number, x.astype(np.float64)) / counts))


def coordinates(points: NDArray[np.void]) -> NDArray[np.float64]:
    """(N, 3) X, Y, Z of `points` in mm."""
    return np.column_stack([points[axis].astype(np.float64) for axis in "xyz"])

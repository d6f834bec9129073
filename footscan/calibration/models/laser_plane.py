"""Where a laser plane lies along the travel."""

import numpy as np
from numpy.typing import NDArray

from schemas.base.image_size import ImageSize
from schemas.calibration import LaserPlane

Floats = NDArray[np.float64]

MIDDLE_Z_MM = 57.0
"""Height at which the offset of a plane holds: the middle of the volume, so that offset and pitch are hardly correlated
where they are estimated."""
BEND_MM = 70.0
"""Half the length over which the sagitta of a bent sheet is given."""


def terms_of_plane(x: Floats, yz: Floats, step: Floats, row: Floats, x_mm: float) -> Floats:
    """Derivatives (N, 7) of X by the seven numbers of a `LaserPlane`, in their order.

    Parameters
    ----------
    x : (N,) mm, by the travel
    yz : (N, 2) mm
    step : (N,) mm from the frame to the next
    row : (N,) as `row_share`
    x_mm : where the offset holds
    """
    y, z = yz.T
    bend = (y / BEND_MM) ** 2
    return np.column_stack([np.ones(len(x)), y, z - MIDDLE_Z_MM, bend, x - x_mm, step, step * row])


def x_in_plane(plane: LaserPlane, x: Floats, yz: Floats, step: Floats, row: Floats) -> Floats:
    """X (N,) of points of a laser plane, mm; parameters as for `terms_of_plane`.

    >>> plane = LaserPlane(head=1, offset_mm=0.5, yaw=0.01, sd=[0.0] * 7)
    >>> place = x_in_plane(plane, np.array([100.0]), np.array([[20.0, 57.0]]), np.array([2.0]), np.array([0.0]))
    >>> print(place.round(3))
    [100.7]
    """
    values = [plane.offset_mm, plane.yaw, plane.pitch, plane.bend_mm, plane.scale]
    values += [plane.delay_frames, plane.shutter_frames]
    return np.asarray(x + terms_of_plane(x, yz, step, row, plane.x_mm) @ values)


def x_in_turned_plane(plane: LaserPlane, x: Floats, yz: Floats) -> Floats:
    """X (N,) of points at Y and Z (N, 2) of a plane whose X at their middle is `x` (N,), all in mm.

    >>> plane = LaserPlane(head=1, offset_mm=0.5, yaw=0.01, sd=[0.0] * 7)
    >>> print(x_in_turned_plane(plane, np.array([100.5]), np.array([[20.0, 57.0]])).round(3))
    [100.7]
    """
    turned = plane.model_copy(update={"offset_mm": 0.0, "scale": 0.0})
    nothing = np.zeros(len(x))
    return x_in_plane(turned, x, yz, nothing, nothing)


def row_share(j: Floats, size: ImageSize) -> Floats:
    """Place of the rows `j`, px, in a picture: -0.5 at its upper border, 0.5 at the lower one.

    >>> print(row_share(np.array([-0.5, 239.5]), ImageSize(480, 640)))
    [-0.5  0. ]
    """
    return np.asarray((j + 0.5) / size.rows - 0.5)

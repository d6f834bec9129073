"""Positions of the cameras, and the part of the laser plane that each one sees."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from footscan.calibration.models.maps import to_world
from footscan.calibration.models.pose import camera_centres
from schemas.calibration import CameraCalibration, LaserPlane

Floats = NDArray[np.float64]

STEPS_A_SIDE = 16
"""Points of each side of a camera's region through which its outline in the plane is drawn. Chosen by hand."""


@dataclass(frozen=True)
class View:
    """The view of one camera: X counts from the plane of the laser that it sees, Y and Z are the scanner's."""

    centre: Floats
    """(3,) position, mm."""
    outline: Floats
    """(M, 2) corners in Y and Z, mm, of the convex part of the laser plane that the calibration supports,
    counterclockwise; (0, 2) if it is not known."""
    plane: LaserPlane | None = None
    """Where the laser plane lies; None if no film has shown it."""
    camera: int = 0
    """Number of the camera, which may have a second view; 0: that of the view."""
    ahead_mm: float = 0.0
    """X of the laser's plane minus X of the head, by its construction."""


def views_of(cameras: Iterable[CameraCalibration]) -> dict[int, View]:
    """Derive the view of each camera whose position follows from its calibration, or from its number.

    Returns
    -------
    View, numbered as in `schemas.calibration.view_number`, -> the view itself.

    Examples
    --------
    A frontal view of 320 x 240 mm, at the typical distance:

    >>> from schemas.calibration import PolynomialMap
    >>> map_ = PolynomialMap(order=1, centre_px=(319.5, 239.5), scale_px=100, alpha_y=[0, 50, 0], alpha_z=[0, 0, -50])
    >>> view = views_of([CameraCalibration(camera=1, map=map_, region_px=[], points=0)])[1]
    >>> print(view.centre.round(3) + 0.0, view.outline.max(axis=0).round(3))
    [300.   0.   0.] [159.75 119.75]
    """
    calibrations = {camera.view: camera for camera in cameras}
    centres = camera_centres(calibrations.values())
    return {
        number: View(centre, _outline(camera), camera.plane, camera.camera, camera.ahead_mm)
        for number, centre in centres.items()
        for camera in (calibrations[number],)
    }


def _outline(camera: CameraCalibration) -> Floats:
    """The convex outline (M, 2) of a camera's region in the laser plane, mm; (0, 2) if its map is singular."""
    right, bottom = np.array(camera.image_size.px) - 1.0
    corners = np.array(camera.region_px or [(0.0, 0.0), (right, 0.0), (right, bottom), (0.0, bottom)])
    parts = np.arange(STEPS_A_SIDE)[:, None, None] / STEPS_A_SIDE
    border = (1 - parts) * corners + parts * np.roll(corners, -1, axis=0)
    plane = to_world(camera, border.reshape(-1, 2))
    try:
        return np.asarray(plane[ConvexHull(plane).vertices])
    except (QhullError, ValueError):  # all points on a line, or not finite
        return np.empty((0, 2))

"""The corners of the reference object as a camera sees them: a chart of control points that nobody clicked."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.edge_points import from_object
from footscan.calibration.capture.lines import find_corners, find_lines
from footscan.calibration.capture.reference import Edges
from footscan.calibration.models.maps import to_world
from schemas.base.units import Point
from schemas.calibration import CameraCalibration

Floats = NDArray[np.float64]

NEAR_MM = 0.5
"""A corner of the stripe as near as this to one of the object is it."""


@dataclass(frozen=True)
class FoundCorner:
    """A corner of the object, where two straight pieces of the stripe meet."""

    camera: int
    frame: int
    pixel: Point
    """(i, j) px, the intersection of the two pieces."""
    world_mm: Point
    """Y and Z of the object's corner."""


def corners_in(
    camera: CameraCalibration, stripes: Sequence[Floats], edges: Edges, poses: Floats
) -> Iterator[FoundCorner]:
    """The corners in what a calibrated camera saw.

    Parameters
    ----------
    stripes : for each of K frames the stripe's points (N, 2), px.
    poses : (K, 3) of the object in each, mm, mm and radians.
    """
    for frame, (stripe, pose) in enumerate(zip(stripes, poses, strict=True)):
        pixels = np.array([corner.position for corner in find_corners(find_lines(stripe), stripe)]).reshape(-1, 2)
        true = from_object(edges.start, pose)
        distance = np.linalg.norm(to_world(camera, pixels)[:, np.newaxis] - true, axis=2)
        for k in np.flatnonzero(distance.min(axis=1, initial=np.inf) < NEAR_MM):
            i, j = pixels[k].tolist()
            corner_y, corner_z = true[distance[k].argmin()].tolist()
            yield FoundCorner(camera.camera, frame, (i, j), (corner_y, corner_z))

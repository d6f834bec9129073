"""The corners of the reference object in the images of a camera: a chart of control points without clicks."""

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
"""Distance up to which a corner of the stripe is that of the object. Chosen by hand."""


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
    """Find the corners of the object in the stripes of a calibrated camera.

    Parameters
    ----------
    stripes : for each of K frames the points (N, 2) of the stripe, px.
    poses : (K, 3) of the object in each frame, mm, mm and radians.
    """
    for frame, (stripe, pose) in enumerate(zip(stripes, poses, strict=True)):
        pixels = np.array([corner.position for corner in find_corners(find_lines(stripe), stripe)]).reshape(-1, 2)
        corners = from_object(edges.start, pose)
        distance = np.linalg.norm(to_world(camera, pixels)[:, np.newaxis] - corners, axis=2)
        for k in np.flatnonzero(distance.min(axis=1, initial=np.inf) < NEAR_MM):
            i, j = pixels[k].tolist()
            corner_y, corner_z = corners[distance[k].argmin()].tolist()
            yield FoundCorner(camera.camera, frame, (i, j), (corner_y, corner_z))

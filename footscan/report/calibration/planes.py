"""Where the laser planes lie, in words for a table."""

import math

from schemas.calibration import Calibration, LaserPlane

UNSUPPORTED = "not supported by the films"
"""In the place of a number that the films do not determine, and which is left at zero."""
HEAD_COLUMNS = ("X, mm", "yaw, °", "pitch, °", "bend, mm", "travel, %")
CAMERA_COLUMNS = ("delay, frames", "shutter, frames")
_DEGREES = math.degrees(1.0)
_SHOWN = ((1.0, 3), (_DEGREES, 3), (_DEGREES, 3), (1.0, 2), (100.0, 3), (1.0, 3), (1.0, 3))
"""Factor and decimals of the seven numbers of a plane."""


def plane_cells(plane: LaserPlane) -> list[str]:
    """The seven numbers of a plane, each with its standard deviation, as in `HEAD_COLUMNS` and `CAMERA_COLUMNS`.

    >>> plane_cells(LaserPlane(head=1, offset_mm=0.5, yaw=0.01, sd=[0.02, 0.001, 0, 0, 0, 0, 0]))[:3]
    ['+0.500 ± 0.020', '+0.573 ± 0.057', 'not supported by the films']
    """
    values = (plane.offset_mm, plane.yaw, plane.pitch, plane.bend_mm, plane.scale, plane.delay_frames)
    return [
        f"{factor * value:+.{decimals}f} ± {factor * sd:.{decimals}f}" if sd > 0 else UNSUPPORTED
        for value, sd, (factor, decimals) in zip((*values, plane.shutter_frames), plane.sd, _SHOWN, strict=True)
    ]


def planes_of_heads(calibration: Calibration) -> list[list[str]]:
    """A row for each laser of each head: its name and the numbers of `HEAD_COLUMNS`; empty without laser planes."""
    planes = {(camera.plane.head, camera.laser): camera.plane for camera in calibration.cameras if camera.plane}
    return [
        [f"head {head}" if laser == 1 else f"head {head}, laser {laser}", *plane_cells(plane)[: len(HEAD_COLUMNS)]]
        for (head, laser), plane in sorted(planes.items())
    ]

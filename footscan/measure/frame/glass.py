"""The glass as the floor of a foot."""

import math

import numpy as np
from numpy.typing import NDArray

from schemas.glass import GlassPlane, Plane

UNSAFE_MM = 3.0
"""Distance from Z = 0 beyond which the plate was not just moved: 3 mm are the seats and shims of a plate. A foot that
stands farther away leaves the part of the laser planes in which the reference object stood. Chosen by hand."""
UNKNOWN_MM, UNKNOWN_DEG = 0.5, 0.2
"""Standard deviations of height and tilt of a plate in its seats, where the scan does not show it. Chosen by hand."""
HALF_FOOT_MM = (100.0, 30.0)
"""Half the length and breadth of a foot's contact."""


def to_glass(plane: Plane) -> NDArray[np.float64]:
    """Returns (4, 4) the rigid transform from the scanner's frame to that of the glass, whose Z = 0 is the plane.

    X stays in its upright plane; the glass at X = Y = 0 becomes the origin.

    >>> moved = to_glass(Plane(1.0, 0.0, 0.01)) @ [5.0, 100.0, 2.0, 1.0]
    >>> print(moved.round(3))
    [  5.    100.005   0.      1.   ]
    """
    up = np.array([-plane.along, -plane.across, 1.0])
    ahead = np.array([1.0, 0.0, plane.along])
    axes = np.array([ahead, np.cross(up, ahead), up])
    transform = np.eye(4)
    transform[:3, :3] = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    transform[:3, 3] = transform[:3, :3] @ [0.0, 0.0, -plane.height]
    return transform


def glass_sd(glass: GlassPlane) -> float:
    """Standard deviation of the height of the glass below a foot, mm; its tilts count at the ends of a foot.

    >>> print(f"{glass_sd(GlassPlane(below_foot_sd_mm=0.03, tilt_x_sd_deg=0.0, tilt_y_sd_deg=0.01)):.3f}")
    0.035
    >>> print(f"{glass_sd(GlassPlane()):.2f}")
    0.62
    """
    height_mm = UNKNOWN_MM if glass.below_foot_sd_mm is None else glass.below_foot_sd_mm
    tilts = (UNKNOWN_DEG if sd is None else sd for sd in (glass.tilt_y_sd_deg, glass.tilt_x_sd_deg))
    return math.hypot(height_mm, *(math.radians(tilt) * mm for tilt, mm in zip(tilts, HALF_FOOT_MM, strict=True)))


def glass_doubt(glass: GlassPlane) -> str | None:
    """Reason for which all measures are uncertain, if the glass is too far from where it was calibrated.

    >>> glass_doubt(GlassPlane(below_foot_mm=3.5, largest_mm=3.6, corrected=True))
    'the glass is up to 3.6 mm from where it was calibrated, more than can be corrected safely: calibrate anew'
    """
    if not glass.corrected or glass.largest_mm <= UNSAFE_MM:
        return None
    return (
        f"the glass is up to {glass.largest_mm:.1f} mm from where it was calibrated, more than can be corrected "
        "safely: calibrate anew"
    )

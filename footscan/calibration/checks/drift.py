"""Drift of a camera since its calibration: the error of the old map on today's stripe over the reference object."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from statistics import median
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.from_capture import CalibratedView
from footscan.calibration.models.maps import is_supported, to_world
from footscan.calibration.models.selection import rms
from schemas.calibration import CameraCalibration

Floats = NDArray[np.float64]

MARGIN_PX = 2.0
"""Distance outside the calibration's region up to which today's stripe is compared. Chosen by hand."""
FEWEST_POINTS = 20
"""Number of points that a comparison needs. Chosen by hand."""
REACH_MM = 50.0
"""Scale of the affine field: about the object's extent, so that its terms have similar size."""
RANK = 1e-6
"""Singular values, relative to the largest, up to which a direction of the field is undetermined."""

Verdict = Literal[
    "steady", "drifted", "not comparable", "not recognised", "not in the capture", "not in the calibration"
]


@dataclass(frozen=True)
class Drift:
    """The drift of one camera. Lengths are in mm, and None without a comparison."""

    camera: int
    """Number of the camera, or of its view of a second laser as in `schemas.calibration.view_number`."""
    verdict: Verdict
    points: int = 0
    """Number of compared points: of today's stripe on the object, in the region that data support."""
    shift_mm: tuple[float, float] | None = None
    """Mean error of the calibration in Y and Z."""
    rms_mm: float | None = None
    """Root mean square distance of the error."""
    worst_mm: float | None = None
    remark: str = ""


def drift_of(calibration: CameraCalibration, today: CalibratedView, tolerance_mm: float) -> Drift:
    """Measure the drift of a camera from today's stripe over the reference object.

    The truth is the edges of the object, to which today's stripe was assigned by a map fitted to itself. The
    calibration's error across an edge is measured. The error along an edge is that of the affine field that fits the
    errors across all edges best.
    """
    camera = calibration.view
    points = today.points.part(is_supported(calibration, today.points.pixels, MARGIN_PX))
    if len(points) < FEWEST_POINTS:
        remark = f"{len(points)} of {len(today.points)} points of the stripe lie where data support the calibration"
        return Drift(camera, "not comparable", len(points), remark=remark)
    across = points.across(to_world(calibration, points.pixels))
    place = to_world(today.calibration, points.pixels)
    terms = np.column_stack([np.ones(len(points)), (place - place.mean(axis=0)) / REACH_MM])
    design = np.concatenate([points.normals[:, [axis]] * terms for axis in (0, 1)], axis=1)
    field = np.linalg.lstsq(design, across, rcond=RANK)[0].reshape(2, 3)
    along = terms @ field.T
    error = along + (across - np.sum(points.normals * along, axis=1))[:, np.newaxis] * points.normals
    distance = np.hypot(error[:, 0], error[:, 1])
    rms_mm = rms(distance)
    return Drift(
        camera,
        "steady" if rms_mm <= tolerance_mm else "drifted",
        len(points),
        (float(error[:, 0].mean()), float(error[:, 1].mean())),
        rms_mm,
        float(distance.max()),
    )


def common_shift(drifts: Sequence[Drift]) -> tuple[float, float] | None:
    """The shift in Y and Z, mm, common to all cameras, if the rest is less than half of it; else None.

    The object was then placed so, rather than the scanner moved.
    """
    shifts = [drift.shift_mm for drift in drifts if drift.shift_mm is not None]
    if len(shifts) < 2:
        return None
    y, z = (median(shift[axis] for shift in shifts) for axis in (0, 1))
    apart = max(hypot(shift[0] - y, shift[1] - z) for shift in shifts)
    return (y, z) if apart < hypot(y, z) / 2 else None

"""How far a camera has drifted since its calibration: where the old map puts what the stripe shows today."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.from_capture import CalibratedView
from footscan.calibration.models.maps import is_supported, to_world
from footscan.calibration.models.selection import rms
from schemas.calibration import CameraCalibration

Floats = NDArray[np.float64]

MARGIN_PX = 2.0
"""The calibration's region ends at its outermost pixels; today's stripe may lie a little beyond them."""
FEWEST_POINTS = 20
REACH_MM = 50.0
"""About the object's extent: it makes the field's terms alike."""

Verdict = Literal[
    "steady", "drifted", "not comparable", "not recognised", "not in the capture", "not in the calibration"
]


@dataclass(frozen=True)
class Drift:
    """What became of one camera. Lengths are mm; None where there is nothing to compare."""

    camera: int
    verdict: Verdict
    points: int = 0
    """Of today's stripe on the object, where data support the calibration."""
    shift_mm: tuple[float, float] | None = None
    """By how much, in the mean, the calibration puts them off their place in Y and Z."""
    rms_mm: float | None = None
    """How far off they are, root mean square."""
    worst_mm: float | None = None
    remark: str = ""


def drift_of(calibration: CameraCalibration, today: CalibratedView, tolerance_mm: float) -> Drift:
    """The drift of a camera, from the stripe over the reference object today.

    Truth are the object's edges, to which today's stripe was assigned by the map that it gives on its own. Across an
    edge the calibration's error is seen; along it, it is that of the affine field which explains the errors across all
    edges best.
    """
    camera = calibration.camera
    points = today.points.part(is_supported(calibration, today.points.pixels, MARGIN_PX))
    if len(points) < FEWEST_POINTS:
        remark = f"{len(points)} of {len(today.points)} points of the stripe lie where data support the calibration"
        return Drift(camera, "not comparable", len(points), remark=remark)
    across = points.across(to_world(calibration, points.pixels))
    place = to_world(today.calibration, points.pixels)
    terms = np.column_stack([np.ones(len(points)), (place - place.mean(axis=0)) / REACH_MM])
    design = np.concatenate([points.normals[:, [axis]] * terms for axis in (0, 1)], axis=1)
    field = np.linalg.lstsq(design, across, rcond=1e-6)[0].reshape(2, 3)
    along = terms @ field.T
    off = along + (across - np.sum(points.normals * along, axis=1))[:, np.newaxis] * points.normals
    distance = np.hypot(off[:, 0], off[:, 1])
    rms_mm = rms(distance)
    return Drift(
        camera,
        "steady" if rms_mm <= tolerance_mm else "drifted",
        len(points),
        (float(off[:, 0].mean()), float(off[:, 1].mean())),
        rms_mm,
        float(distance.max()),
    )

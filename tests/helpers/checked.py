"""Checks of a calibration, as `footscan calibrate check` would write them."""

import datetime
import hashlib
from collections.abc import Mapping
from pathlib import Path

from schemas.calibration_check import CalibrationCheck, CameraCheck, verdict_in_all

TOLERANCE_MM = 0.2


def made_check(
    calibration: Path, when: str, off_mm: Mapping[int, float | None], reason: str = "not in the capture"
) -> CalibrationCheck:
    """A check of a calibration file; `off_mm`: deviation of each camera, None for one that could not be judged."""
    cameras = [
        CameraCheck(camera=camera, verdict="unseen", reason=reason)
        if mm is None
        else CameraCheck(
            camera=camera,
            verdict="steady" if mm <= TOLERANCE_MM else "drifted",
            points=800,
            shift_mm=(0.0, mm),
            rms_mm=mm,
            worst_mm=2 * mm,
        )
        for camera, mm in off_mm.items()
    ]
    return CalibrationCheck(
        checked=datetime.datetime.fromisoformat(when),
        software="tests",
        calibration_sha256=hashlib.sha256(calibration.read_bytes()).hexdigest(),
        tolerance_mm=TOLERANCE_MM,
        sources=[],
        verdict=verdict_in_all(cameras),
        cameras=cameras,
    )

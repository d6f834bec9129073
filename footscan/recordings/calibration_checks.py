"""Checks of a calibration that lie beside it, and the choice of the one that a scan has."""

import datetime
import re
from collections.abc import Collection, Sequence
from pathlib import Path

from footscan.recordings.scans import RecordedScan
from schemas.base.errors import RefusedInput
from schemas.base.json_files import read_json
from schemas.calibration_check import CalibrationCheck, ScanCheck


def check_path(calibration: Path) -> Path:
    """The file of the last check of a calibration: beside the file itself, not beside a link to it."""
    file = calibration.resolve()
    return file.with_name(f"{file.stem}.check.json")


def earlier_path(calibration: Path, check: CalibrationCheck) -> Path:
    """The file that keeps a check after a later one was made."""
    file = calibration.resolve()
    return file.with_name(f"{file.stem}.check-{check.checked.astimezone(datetime.UTC):%Y%m%dT%H%M%SZ}.json")


def checks_of(calibration: Path, calibration_sha256: str) -> list[CalibrationCheck]:
    """All checks beside a calibration file that judge the calibration of that digest, the earliest first.

    A check of another calibration, such as one that the file held before, does not count.

    Raises
    ------
    RefusedInput
        A check cannot be read or is damaged.
    """
    file = calibration.resolve()
    pattern = re.compile(rf"{re.escape(file.stem)}\.check(-\d{{8}}T\d{{6}}Z)?\.json")
    try:
        paths = sorted(path for path in file.parent.iterdir() if pattern.fullmatch(path.name))
    except OSError as error:
        raise RefusedInput(file.parent, f"cannot be listed ({error.strerror})") from None
    checks = [read_json(path, CalibrationCheck) for path in paths]
    judging = [check for check in checks if check.calibration_sha256 == calibration_sha256]
    return sorted(judging, key=lambda check: check.checked)


def check_of_scan(scan: RecordedScan, calibration_sha256: str, checks: Sequence[CalibrationCheck]) -> ScanCheck | None:
    """What is known of the calibration of a scan from its last check; None without one.

    The check that the scan itself carries comes first, if it judges the calibration that is used. Otherwise it is the
    last of `checks`, those beside the calibration, up to the day of the scan; the last one if the day is unknown.

    Raises
    ------
    RefusedInput
        The check that the scan carries is missing or damaged.
    """
    day = scan.document.day
    own = None if scan.calibration_check is None else read_json(scan.calibration_check, CalibrationCheck)
    if own is None or own.calibration_sha256 != calibration_sha256:
        before = [check for check in checks if day is None or check.checked.date() <= day]
        if not before:
            return None
        own = before[-1]
    return for_cameras(own, {camera.id for camera in scan.document.cameras}, day)


def for_cameras(check: CalibrationCheck, cameras: Collection[int], day: datetime.date | None) -> ScanCheck:
    """What a check says of some cameras, seen from a day (None: unknown).

    A camera that the check does not name could not be judged either. Figures are rounded to 0.01 mm, which is what a
    sentence shows, so that the further digits of a repeated check change nothing.
    """
    judged = [camera for camera in check.cameras if camera.camera in cameras]
    verdicts = {camera.camera: camera.verdict for camera in judged}
    off_mm = [camera.rms_mm for camera in judged if camera.rms_mm is not None]
    on = check.checked.date()
    return ScanCheck(
        checked=on,
        age_days=None if day is None else max((day - on).days, 0),
        largest_mm=round(max(off_mm), 2) if off_mm else None,
        drifted=sorted(camera for camera in cameras if verdicts.get(camera) == "drifted"),
        unseen=sorted(camera for camera in cameras if verdicts.get(camera, "unseen") == "unseen"),
    )

"""Checks of a calibration: the verdict of each as a document, kept beside the calibration.

`calibration.check.json` is the last check of calibration.json. Earlier ones lie beside it with their time in the name,
such as calibration.check-20261124T081502Z.json, because a scan has the last check before its own day.
"""

import datetime
from collections.abc import Collection, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from footscan.recordings.calibration_checks import check_path, checks_of, earlier_path, for_cameras
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import sha256
from pipelines.version import SOFTWARE
from schemas.base.errors import RefusedInput
from schemas.base.json_files import read_json, read_text
from schemas.calibration import LARGEST, Source
from schemas.calibration_check import CalibrationCheck, CameraCheck, ScanCheck, verdict_in_all

if TYPE_CHECKING:
    from footscan.calibration.checks.drift import Drift
    from pipelines.recordings.captures import RecordedCapture


def check_document(
    calibration_sha256: str,
    capture: "RecordedCapture",
    drifts: "Sequence[Drift]",
    tolerance_mm: float,
    *,
    scanner: str | None = None,
    checked: datetime.datetime | None = None,
) -> CalibrationCheck:
    """Build the document of a check from the drift of each camera, see `pipelines.capture_job.check_calibration`.

    Parameters
    ----------
    calibration_sha256 : str
        Digest of the calibration file whose drift was measured.
    scanner : str, optional
        Name of the scanner, if known.
    checked : datetime, optional
        Time of the check, with its time zone; default: now.

    Raises
    ------
    RefusedInput
        A file of the capture cannot be read any more.
    """
    cameras = [_camera(drift) for drift in drifts]
    now = datetime.datetime.now().astimezone().replace(microsecond=0)
    return CalibrationCheck(
        checked=checked or now,
        scanner=scanner,
        software=SOFTWARE,
        calibration_sha256=calibration_sha256,
        tolerance_mm=tolerance_mm,
        sources=[_source(file, capture.folder) for file in capture.files],
        verdict=verdict_in_all(cameras),
        cameras=cameras,
    )


def store_check(calibration: Path, check: CalibrationCheck) -> Path:
    """Write a check beside its calibration and return its path; a check that lies there keeps its time as its name.

    Raises
    ------
    RefusedInput
        The check that lies there is damaged: it is not overwritten.
    Fault
        The file cannot be written.
    """
    path = check_path(calibration)
    if path.exists() and (earlier := read_json(path, CalibrationCheck)) != check:
        write_atomically(earlier_path(calibration, earlier), path.read_bytes())
    write_atomically(path, (check.model_dump_json(indent=2) + "\n").encode())
    return path


def check_of(calibration: Path) -> CalibrationCheck | None:
    """The last check of the calibration file as it is now; None without one.

    Raises
    ------
    RefusedInput
        The calibration, or a check beside it, cannot be read or is damaged.
    """
    digest = sha256(read_text(calibration, "json_bytes").encode())
    last = check_path(calibration)
    if last.exists() and (check := read_json(last, CalibrationCheck)).calibration_sha256 == digest:
        return check  # without a look at years of earlier ones: the operator's page asks again and again
    checks = checks_of(calibration, digest)
    return checks[-1] if checks else None


def check_in_force(calibration: Path | None) -> CalibrationCheck | None:
    """The check that a scan which begins now carries; None without a check, or without a calibration file.

    Raises
    ------
    RefusedInput
        As in `check_of`.
    """
    return None if calibration is None or not calibration.exists() else check_of(calibration)


def scanner_check(calibration: Path | None, cameras: Collection[int]) -> ScanCheck | None:
    """What `check_in_force` says today of the cameras of a scanner; raises as it does."""
    check = check_in_force(calibration)
    today = datetime.datetime.now().astimezone().date()
    return None if check is None else for_cameras(check, cameras, today)


def _camera(drift: "Drift") -> CameraCheck:
    figures = (*(drift.shift_mm or ()), drift.rms_mm, drift.worst_mm)
    if drift.shift_mm is None or not all(mm is not None and isfinite(mm) and abs(mm) <= LARGEST for mm in figures):
        why = drift.verdict if drift.shift_mm is None else "the map leads to no place in mm"
        reason = f"{why} ({drift.remark})" if drift.remark else why
        return CameraCheck(camera=drift.camera, verdict="unseen", reason=reason[:1000], points=drift.points)
    return CameraCheck(
        camera=drift.camera,
        verdict="steady" if drift.verdict == "steady" else "drifted",
        reason=drift.remark[:1000] or None,
        points=drift.points,
        shift_mm=drift.shift_mm,
        rms_mm=drift.rms_mm,
        worst_mm=drift.worst_mm,
    )


def _source(file: Path, folder: Path) -> Source:
    try:
        return Source(name=file.relative_to(folder).as_posix(), sha256=sha256(file.read_bytes()))
    except OSError as error:
        raise RefusedInput(file, f"cannot be read ({error.strerror})") from None

"""Checks of a calibration: the verdict of each as a document, kept beside the calibration.

`calibration.check.json` is the last check of calibration.json. Earlier ones lie beside it with their time in the name,
such as calibration.check-20261124T081502Z.json, because a scan has the last check before its own day.
"""

import datetime
import re
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import sha256
from pipelines.version import SOFTWARE
from schemas.base.errors import RefusedInput
from schemas.base.json_files import read_json, read_text
from schemas.calibration import LARGEST, Source
from schemas.calibration_check import CalibrationCheck, CameraCheck, verdict_in_all

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
        name = f"{calibration.stem}.check-{earlier.checked.astimezone(datetime.UTC):%Y%m%dT%H%M%SZ}.json"
        write_atomically(path.with_name(name), path.read_bytes())
    write_atomically(path, (check.model_dump_json(indent=2) + "\n").encode())
    return path


def check_path(calibration: Path) -> Path:
    """The file of the last check of a calibration."""
    return calibration.with_name(f"{calibration.stem}.check.json")


def check_of(calibration: Path) -> CalibrationCheck | None:
    """The last check of the calibration file as it is now; None without one.

    Raises
    ------
    RefusedInput
        The calibration, or a check beside it, cannot be read or is damaged.
    """
    checks = checks_of(calibration, sha256(read_text(calibration, "json_bytes").encode()))
    return checks[-1] if checks else None


def checks_of(calibration: Path, calibration_sha256: str) -> list[CalibrationCheck]:
    """All checks beside a calibration file that judge the calibration of that digest, the earliest first.

    A check of another calibration, such as one that the file held before, does not count.

    Raises
    ------
    RefusedInput
        A check cannot be read or is damaged.
    """
    pattern = re.compile(rf"{re.escape(calibration.stem)}\.check(-\d{{8}}T\d{{6}}Z)?\.json")
    try:
        paths = sorted(path for path in calibration.parent.iterdir() if pattern.fullmatch(path.name))
    except OSError as error:
        raise RefusedInput(calibration.parent, f"cannot be listed ({error.strerror})") from None
    checks = [read_json(path, CalibrationCheck) for path in paths]
    judging = [check for check in checks if check.calibration_sha256 == calibration_sha256]
    return sorted(judging, key=lambda check: check.checked)


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

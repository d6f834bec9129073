"""What a session ends in: a stored calibration, its laser planes, its name in rig.yaml, or the verdict of a check."""

import datetime
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from footscan.calibration.checks.drift import Drift, common_shift
from footscan.calibration.travel.body import Body
from footscan.recordings.scans import read_scan
from footscan.report.calibration.figure import calibration_figure
from pipelines.calibration_check import check_document, store_check
from pipelines.capture_job import calibrate_capture, check_calibration
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import sha256
from pipelines.engine.pool import cores
from pipelines.live.rig_file import read_rig, write_rig
from pipelines.recordings.captures import read_capture
from pipelines.scan import CalibrationFile
from pipelines.travel_job import calibrate_travel
from schemas.base.errors import RefusedInput
from schemas.base.json_files import read_text
from schemas.calibration import Calibration, calibration_from_json
from schemas.calibration_check import CalibrationCheck, CameraCheck
from schemas.parameters.calibration import CaptureCalibrationParameters
from schemas.rig import Rig


@dataclass(frozen=True)
class StoredCalibration:
    """A calibration and its files."""

    file: Path
    calibration: Calibration

    @property
    def picture(self) -> Path:
        """The figure of residuals and coverage."""
        return self.file.with_suffix(".png")

    def remarks(self) -> list[str]:
        """What an operator must know of it, a sentence each."""
        return list(self.calibration.warnings)

    def rows(self) -> list[tuple[str, ...]]:
        """Camera, number of points, own and held-out error, mm."""
        return [
            (
                f"{camera.camera}",
                f"{camera.points}",
                *("-" if mm is None else f"{mm:.3f}" for mm in (camera.rms_mm, camera.held_out_rms_mm)),
            )
            for camera in self.calibration.cameras
        ]


@dataclass(frozen=True)
class StoredCheck:
    """The verdict of a check and its file."""

    file: Path
    check: CalibrationCheck
    drifts: Sequence[Drift]

    def remarks(self) -> list[str]:
        """The verdict in all, and on each camera that does not hold, a sentence each."""
        bad = [f"camera {camera.camera} {_verdict(camera.rms_mm, camera.reason)}" for camera in self._not_steady()]
        if not bad:
            largest = max((camera.rms_mm or 0.0 for camera in self.check.cameras), default=0.0)
            return [f"The calibration holds: every camera is within {largest:.2f} mm."]
        alike = common_shift(self.drifts)
        if alike is not None:
            y, z = alike
            bad.append(
                f"all cameras are off alike, by {y:+.2f}, {z:+.2f} mm: perhaps the object stood so. Place it again"
            )
        return [f"{words[0].upper()}{words[1:]}." for words in bad]

    def rows(self) -> list[tuple[str, ...]]:
        """Camera, number of points, deviation in Y, Z and in all, mm, and verdict."""
        return [
            (
                f"{camera.camera}",
                f"{camera.points}",
                *("-" if mm is None else f"{mm:+.3f}" for mm in (camera.shift_mm or (None, None))),
                "-" if camera.rms_mm is None else f"{camera.rms_mm:.3f}",
                camera.verdict,
            )
            for camera in self.check.cameras
        ]

    def _not_steady(self) -> Iterator[CameraCheck]:
        return (camera for camera in self.check.cameras if camera.verdict != "steady")


def calibrate_session(capture: Path, rig: Rig, rig_file: Path, tolerance_mm: float) -> StoredCalibration:
    """Calibrate from a capture and store the result beside rig.yaml, as `calibration-S1-2026-11-24.json` or so.

    Raises
    ------
    RefusedInput
        A `RefusedCapture`: the object is not recognised, or was wrongly placed.
    """
    parameters = CaptureCalibrationParameters(placement_tolerance_mm=tolerance_mm)
    made = calibrate_capture(read_capture(capture), parameters, cores())
    return _stored(_free_file(rig_file.parent, rig.scanner), made.calibration, rig.scanner)


def add_planes(stored: StoredCalibration, film: Path, rig: Rig, body: Body) -> StoredCalibration:
    """Find the laser planes in the film of a body, and store them in the calibration.

    Raises
    ------
    RefusedInput
        The film does not show the body.
    """
    known = CalibrationFile(stored.file, stored.calibration, sha256(stored.file.read_bytes()))
    heads = {camera.id: camera.on_head for camera in rig.cameras}
    return _stored(stored.file, calibrate_travel(read_scan(film), known, heads, body, cores()), rig.scanner)


def use_calibration(stored: StoredCalibration, rig: Rig, rig_file: Path) -> Rig:
    """Name a calibration in rig.yaml, as it is by now, and return the `rig` that does."""
    named = {"calibration": str(stored.file.resolve())}
    write_rig(rig_file, read_rig(rig_file).model_copy(update=named))
    return rig.model_copy(update=named)


def check_session(capture: Path, rig: Rig, tolerance_mm: float, placement_tolerance_mm: float) -> StoredCheck:
    """Measure how far each camera is off its calibration, and store the verdict beside the calibration.

    Raises
    ------
    RefusedInput
        The rig names no calibration, or the object is not recognised.
    """
    if rig.calibration is None:
        raise RefusedInput("rig", "names no calibration, expected one that can be checked", field="calibration")
    file = Path(rig.calibration)
    text = read_text(file, "json_bytes")
    parameters = CaptureCalibrationParameters(placement_tolerance_mm=placement_tolerance_mm)
    today = read_capture(capture)
    drifts = check_calibration(calibration_from_json(text, file), today, parameters, tolerance_mm, cores())
    check = check_document(sha256(text.encode()), today, drifts, tolerance_mm, scanner=rig.scanner)
    return StoredCheck(store_check(file, check), check, drifts)


def _stored(file: Path, calibration: Calibration, scanner: str) -> StoredCalibration:
    now = datetime.datetime.now(datetime.UTC).replace(microsecond=0)
    dated = calibration.model_copy(update={"created": now, "scanner": scanner})
    write_atomically(file, (dated.model_dump_json(indent=2) + "\n").encode())
    stored = StoredCalibration(file, dated)
    write_atomically(stored.picture, calibration_figure(dated))
    return stored


def _free_file(folder: Path, scanner: str) -> Path:
    first = f"calibration-{scanner}-{datetime.datetime.now().astimezone().date().isoformat()}"
    names = [first, *(f"{first}-{number}" for number in range(2, len(list(folder.glob(f"{first}*"))) + 3))]
    return next(folder / f"{name}.json" for name in names if not (folder / f"{name}.json").exists())


def _verdict(rms_mm: float | None, reason: str | None) -> str:
    if rms_mm is None:
        return f"could not be checked ({reason})"
    return f"has moved by {rms_mm:.1f} mm: calibrate anew"

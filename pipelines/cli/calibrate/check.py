"""`footscan calibrate check`."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.calibrate.refused_picture import Picture, drawn
from pipelines.cli.terminal.output import AsJson, figure, keep_inputs, message, note, print_json, print_table

if TYPE_CHECKING:
    from footscan.calibration.checks.drift import Drift


def check(
    calibration: Annotated[Path, typer.Argument(help="Calibration file.")],
    capture: Annotated[Path, typer.Argument(help="Folder with capture.yaml, filmed today.")],
    tolerance_mm: Annotated[
        float, typer.Option(min=0.001, max=100, help="RMS deviation in mm above which a camera has drifted.")
    ] = 0.2,
    placement_tolerance_mm: Annotated[
        float, typer.Option(min=0.01, max=50, help="Largest distance in mm of the object from its nominal placement.")
    ] = 1.0,
    picture: Picture = None,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of a result store; results of this capture that it holds are reused.")
    ] = None,
    record: Annotated[
        bool,
        typer.Option("--record/--no-record", help="Keep the verdict beside the calibration: later scans carry it."),
    ] = True,
    as_json: AsJson = False,
) -> int:
    """Measure the drift of each camera since its calibration. The exit status is 1 if a camera has drifted."""
    from footscan.recordings.calibration_checks import check_path
    from pipelines.calibration_check import check_document, store_check
    from pipelines.capture_job import check_calibration
    from pipelines.engine.files.digest import sha256
    from pipelines.engine.pool import cores
    from pipelines.recordings.captures import read_capture
    from schemas.base.json_files import read_text
    from schemas.calibration import calibration_from_json
    from schemas.parameters.calibration import CaptureCalibrationParameters

    today = read_capture(capture)
    keep_inputs([picture, check_path(calibration) if record else None], calibration, *today.files)
    known_text = read_text(calibration, "json_bytes")
    known = calibration_from_json(known_text, calibration)
    parameters = CaptureCalibrationParameters(placement_tolerance_mm=placement_tolerance_mm)
    with drawn(today, picture):
        drifts = check_calibration(known, today, parameters, tolerance_mm, cores(), cache)
    document = check_document(sha256(known_text.encode()), today, drifts, tolerance_mm)
    if as_json:
        print_json(
            {
                "verdict": document.verdict,
                "tolerance_mm": tolerance_mm,
                "cameras": [asdict(drift) for drift in drifts],
            }
        )
    else:
        _print_drifts(drifts)
    _tell_verdict(calibration, drifts, tolerance_mm)
    if record:
        note(f"{store_check(calibration, document)}: the verdict, which scans carry from now on")
    return 0 if document.verdict == "steady" else 1


def _tell_verdict(calibration: Path, drifts: "list[Drift]", tolerance_mm: float) -> None:
    from footscan.calibration.checks.drift import common_shift

    moved = [drift for drift in drifts if drift.verdict != "steady"]
    if not moved:
        note(f"{calibration}: holds; every camera is within {tolerance_mm:g} mm")
        return
    if (alike := common_shift(drifts)) is not None:
        y, z = alike
        message(
            f"all cameras are off alike, by {y:+.2f}, {z:+.2f} mm: perhaps the object stood so, not the scanner moved"
        )
    said = "; ".join(f"camera {drift.camera} {_said(drift)}" for drift in moved)
    message(f"{calibration}: does not hold: {said}; {tolerance_mm:g} mm are allowed")


def _said(drift: "Drift") -> str:
    if drift.rms_mm is None:
        return f"is {drift.verdict}" + (f" ({drift.remark})" if drift.remark else "")
    return f"is off by {drift.rms_mm:.2f} mm" + (f" ({drift.remark})" if drift.remark else "")


def _print_drifts(drifts: "list[Drift]") -> None:
    rows = [
        [
            str(drift.camera),
            str(drift.points),
            *(["-", "-"] if drift.shift_mm is None else [f"{mm:+.3f}" for mm in drift.shift_mm]),
            figure(drift.rms_mm),
            figure(drift.worst_mm),
            drift.verdict,
        ]
        for drift in drifts
    ]
    columns = ["camera", "points", "Y mm", "Z mm", "off rms mm", "worst mm", "verdict"]
    print_table("Where the calibration puts today's stripe, against where it is", columns, rows)

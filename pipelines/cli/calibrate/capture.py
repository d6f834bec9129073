"""`footscan calibrate capture`."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pipelines.cli.calibrate.file import print_pairs, tell_calibration, write_calibration
from pipelines.cli.calibrate.refused_picture import Picture, drawn
from pipelines.cli.terminal.output import AsJson, keep_inputs, message, note, print_json
from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.capture_job import CaptureCalibration


def capture(
    folder: Annotated[Path, typer.Argument(help="Folder with capture.yaml, the reference object and the frames.")],
    model: Annotated[
        Literal["auto", "polynomial", "homography", "homography-distortion", "homography-correction"],
        typer.Option(help="auto: smallest error on held-out edges."),
    ] = "auto",
    order: Annotated[
        int | None, typer.Option(min=1, max=5, help="Order of the polynomial; default: chosen on held-out data.")
    ] = None,
    tolerance_mm: Annotated[
        float, typer.Option(min=0.01, max=50, help="Largest distance in mm of the object from its nominal placement.")
    ] = 1.0,
    out: Annotated[Path | None, typer.Option(help="Calibration file to write.")] = None,
    chart: Annotated[
        Path | None, typer.Option(help="Chart of control points to write: the corners that were found (CSV).")
    ] = None,
    picture: Picture = None,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of a result store; results of this capture that it holds are reused.")
    ] = None,
    keep_going: Annotated[
        bool,
        typer.Option("--keep-going", help="Continue when a camera sees the object from another side than its own."),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Calibrate from films of the stripe over the reference object, without clicking points."""
    from pipelines.capture_job import calibrate_capture
    from pipelines.cli.calibrate.model_table import print_trials
    from pipelines.cli.terminal.progress import frame_progress
    from pipelines.engine.pool import cores
    from pipelines.recordings.captures import read_capture
    from schemas.parameters.calibration import CaptureCalibrationParameters

    if order is not None and model != "polynomial":
        raise RefusedInput("--order", "goes with --model polynomial alone")
    recorded = read_capture(folder)
    keep_inputs([out, chart, picture], *recorded.files)
    parameters = CaptureCalibrationParameters(model=model, order=order, placement_tolerance_mm=tolerance_mm)
    with drawn(recorded, picture), frame_progress("calibrating") as progress:
        made = calibrate_capture(recorded, parameters, cores(), cache, keep_going=keep_going, on_progress=progress)
    calibration = made.calibration
    write_calibration(calibration, out)
    if chart is not None:
        _write_chart(chart, made)
    if as_json:
        print_json(
            {
                "cameras": [camera.model_dump(mode="json") for camera in calibration.cameras],
                "trials": [asdict(trial) for trial in made.trials],
                "pairs": [pair.model_dump(mode="json") for pair in calibration.pairs],
                "warnings": calibration.warnings,
                "departures_mm": made.departures_mm.tolist(),
            }
        )
    else:
        print_trials(made.trials)
        print_pairs(calibration.pairs)
    for number, (y, z) in enumerate(made.departures_mm):
        if y or z:
            message(
                f"frame {number}: the cameras agree that the object stood {y:+.2f}, {z:+.2f} mm from where it should"
            )
    for warning in calibration.warnings:
        message(f"{folder}: {warning}")
    tell_calibration(calibration, out)


def _write_chart(file: Path, made: "CaptureCalibration") -> None:
    from pipelines.engine.files.atomic import write_atomically

    maps = {camera.view: camera for camera in made.calibration.cameras}
    has_lasers = any(camera.laser > 1 for camera in maps.values())
    lines = ["camera,point,x_mm,y_mm,z_mm,i,j" + ",laser" * has_lasers + "\n"]
    for number, corner in enumerate(made.corners, start=1):
        (i, j), (y, z), seen = corner.pixel, corner.world_mm, maps[corner.camera]
        place = f"{made.x_mm + seen.ahead_mm:g},{y:.4f},{z:.4f},{i:.3f},{j:.3f}"
        lines.append(f"{seen.camera},{number},{place}" + f",{seen.laser}" * has_lasers + "\n")
    write_atomically(file, "".join(lines).encode())
    note(f"{file}: {len(made.corners)} corners")

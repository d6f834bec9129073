"""`footscan calibrate show`."""

from pathlib import Path
from typing import Annotated

import typer

from pipelines.cli.calibrate.file import print_pairs
from pipelines.cli.terminal.output import AsJson, figure, keep_inputs, note, print_json, print_line, print_table


def show(
    calibration: Annotated[Path, typer.Argument(help="Calibration file.")],
    out: Annotated[
        Path | None, typer.Option(help="Picture to write (PNG).", show_default="beside the calibration")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Draw residuals and coverage of each camera, and print the sources of a calibration."""
    from footscan.calibration.models.maps import model_of
    from footscan.report.calibration.figure import calibration_figure
    from pipelines.engine.files.atomic import write_atomically
    from schemas.calibration import read_calibration

    known = read_calibration(calibration)
    picture = out or calibration.with_suffix(".png")
    keep_inputs([picture], calibration)
    if as_json:
        print_json(known.model_dump(mode="json"))
    else:
        rows = [
            [
                str(camera.camera),
                model_of(camera.map)[0].name,
                str(camera.points),
                *(figure(mm) for mm in (camera.rms_mm, camera.held_out_rms_mm, camera.worst_mm)),
                figure(camera.condition, ".3g"),
                f"{len(camera.region_px)} corners" if camera.region_px else "unknown",
            ]
            for camera in known.cameras
        ]
        columns = ["camera", "model", "points", "own rms mm", "held-out rms mm", "worst mm", "condition", "region"]
        print_table("", columns, rows)
        print_line(
            "Condition: how much the fit magnifies errors of its data. Region: the hull of the pixels it was fitted to."
        )
        print_pairs(known.pairs)
        made = f" at {known.created:%Y-%m-%d %H:%M} UTC" if known.created else ""
        for warning in known.warnings:
            print_line(f"Warning: {warning}")
        print_line(f"Made by {known.software}{made} from {len(known.sources)} files:")
        for source in known.sources:
            print_line(f"  {source.name}  {source.sha256[:16]}")
    write_atomically(picture, calibration_figure(known))
    note(f"{picture}: residuals and coverage")

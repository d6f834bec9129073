"""`footscan calibrate` and `footscan map`."""

import csv
import io
from pathlib import Path
from typing import Annotated, Any

import typer

from pipelines.cli.calibrate import capture, chart, check, chessboard, compare, film, latency, show, travel
from pipelines.cli.terminal.output import AsJson, print_json, print_text

calibrate = typer.Typer(help="Fit each camera's map from pixels to millimetres, and check it.", no_args_is_help=True)
calibrate.command("chart")(chart.chart)
calibrate.command("film")(film.film)
calibrate.command("morning")(film.morning)
calibrate.command("capture")(capture.capture)
calibrate.command("chessboard")(chessboard.chessboard)
calibrate.command("travel")(travel.travel)
calibrate.command("body")(travel.body)
calibrate.command("models")(chart.models)
calibrate.command("show")(show.show)
calibrate.command("check")(check.check)
calibrate.command("compare")(compare.compare)
calibrate.command("latency")(latency.latency)


def map_pixels(
    calibration: Annotated[Path, typer.Argument(help="Calibration file.")],
    points: Annotated[Path, typer.Argument(help="CSV with columns i,j (other columns are ignored).")],
    camera: Annotated[int, typer.Option(help="Number of the camera.")],
    out: Annotated[Path | None, typer.Option(help="CSV to write: y_mm,z_mm,supported.")] = None,
    as_json: AsJson = False,
) -> None:
    """Map pixels of one camera to Y and Z in mm."""
    from footscan.calibration.models.maps import is_supported, to_world
    from footscan.calibration.models.pixels import read_pixels
    from pipelines.engine.files.atomic import write_atomically
    from schemas.calibration import read_calibration

    model = read_calibration(calibration).camera(camera, calibration)
    pixels = read_pixels(points)
    world = to_world(model, pixels)
    inside = is_supported(model, pixels)
    rows: list[dict[str, Any]] = [
        {"y_mm": round(float(y), 6), "z_mm": round(float(z), 6), "supported": bool(s)}
        for (y, z), s in zip(world, inside, strict=True)
    ]
    if out is not None:
        write_atomically(out, _csv(rows).encode())
    if as_json:
        print_json(rows)
    elif out is None:
        print_text(_csv(rows))


def _csv(rows: list[dict[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, ["y_mm", "z_mm", "supported"], lineterminator="\n")
    writer.writeheader()
    writer.writerows({**row, "supported": str(row["supported"]).lower()} for row in rows)
    return text.getvalue()

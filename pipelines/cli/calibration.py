"""`footscan calibrate` and `footscan map`."""

import csv
import io
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from pipelines.cli.output import AsJson, message, print_json, print_table
from schemas.errors import RefusedInput

if TYPE_CHECKING:
    from footscan.calibration.chart import Chart
    from footscan.calibration.fit import OrderTrial
    from schemas.calibration import Calibration

calibrate = typer.Typer(help="Learn each camera's map from pixels to millimetres.", no_args_is_help=True)


@calibrate.callback()
def _calibrate() -> None:
    """Keeps `chart` a sub-command."""


@calibrate.command("chart")
def chart(
    file: Annotated[Path, typer.Argument(help="CSV: camera,point,x_mm,y_mm,z_mm,i,j (or x_cm, y_cm, z_cm).")],
    model: Annotated[
        Literal["polynomial", "quadratic"],
        typer.Option(help="polynomial: order 1 to 5 by held-out error; quadratic: second order of the plain pixels."),
    ] = "polynomial",
    order: Annotated[
        int | None, typer.Option(min=1, max=5, help="Order of the polynomial, instead of a choice.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write the calibration here.")] = None,
    as_json: AsJson = False,
) -> None:
    """Calibrate from control points whose pixels are known."""
    from footscan.calibration.chart import read_chart
    from footscan.calibration.fit import calibrate_chart
    from pipelines.engine.atomic import write_atomically
    from pipelines.engine.digest import sha256
    from pipelines.version import SOFTWARE
    from schemas.parameters.calibration import ChartCalibrationParameters

    if order is not None and model == "quadratic":
        raise RefusedInput("--order", "goes with the model polynomial; quadratic has order 2")
    charts = read_chart(file)
    calibration, trials = calibrate_chart(
        charts,
        parameters=ChartCalibrationParameters(model=model, order=order),
        source=file.name,
        source_sha256=sha256(file.read_bytes()),
        software=SOFTWARE,
    )
    if out is not None:
        write_atomically(out, (calibration.model_dump_json(indent=2) + "\n").encode())
    if model == "quadratic":
        _print_quadratic(charts, as_json=as_json)
    else:
        _print_trials(calibration, trials, as_json=as_json)
    if out is None:
        message("nothing was written; --out FILE writes the calibration")
    else:
        message(f"{out}: calibration of {len(calibration.cameras)} cameras")


def map_pixels(
    calibration: Annotated[Path, typer.Argument(help="Calibration file.")],
    points: Annotated[Path, typer.Argument(help="CSV with columns i,j (others are passed over).")],
    camera: Annotated[int, typer.Option(help="Whose pixels they are.")],
    out: Annotated[Path | None, typer.Option(help="CSV to write: y_mm,z_mm,supported.")] = None,
    as_json: AsJson = False,
) -> None:
    """Map pixels of one camera to Y and Z in millimetres."""
    from footscan.calibration.pixels import read_pixels
    from footscan.calibration.polynomial import evaluate, supported
    from pipelines.engine.atomic import write_atomically
    from schemas.calibration import read_calibration

    model = read_calibration(calibration).camera(camera, calibration)
    pixels = read_pixels(points)
    world = evaluate(model, pixels)
    inside = supported(model, pixels, margin_px=0.0)
    rows: list[dict[str, Any]] = [
        {"y_mm": round(float(y), 6), "z_mm": round(float(z), 6), "supported": bool(s)}
        for (y, z), s in zip(world, inside, strict=True)
    ]
    if out is not None:
        write_atomically(out, _csv(rows).encode())
    if as_json:
        print_json(rows)
    elif out is None:
        print(_csv(rows), end="")


def _csv(rows: list[dict[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, ["y_mm", "z_mm", "supported"], lineterminator="\n")
    writer.writeheader()
    writer.writerows({**row, "supported": str(row["supported"]).lower()} for row in rows)
    return text.getvalue()


def _print_quadratic(charts: "dict[int, Chart]", *, as_json: bool) -> None:
    from footscan.calibration.quadratic import fit_quadratic

    fits = {camera: fit_quadratic(chart) for camera, chart in charts.items()}
    if as_json:
        print_json(
            [
                {
                    "camera": camera,
                    "model": "quadratic",
                    "unit": charts[camera].unit,
                    "points": len(charts[camera].points),
                    "alpha_y": list(fit.alpha_y),
                    "alpha_z": list(fit.alpha_z),
                    "r2_y": fit.r2_y,
                    "r2_z": fit.r2_z,
                    "remark": fit.remark,
                }
                for camera, fit in fits.items()
            ]
        )
        return
    names = ("1", "i", "j", "i^2", "ij", "j^2")
    rows = [
        [str(camera), axis, *(f"{a:.5f}" for a in alpha), "-" if r2 is None else f"{r2:.4f}"]
        for camera, fit in fits.items()
        for axis, alpha, r2 in (("Y", fit.alpha_y, fit.r2_y), ("Z", fit.alpha_z, fit.r2_z))
    ]
    units = "/".join(sorted({chart.unit for chart in charts.values()}))
    print_table(f"Quadratic of the pixel, in {units}", ["camera", "of", *names, "R^2"], rows)
    for remark in sorted({fit.remark for fit in fits.values() if fit.remark}):
        print(remark)


def _print_trials(calibration: "Calibration", trials: "list[OrderTrial]", *, as_json: bool) -> None:
    if as_json:
        print_json(
            [
                {
                    "camera": camera.camera,
                    "model": camera.model,
                    "order": camera.order,
                    "points": camera.points,
                    "rms_mm": camera.rms_mm,
                    "held_out_rms_mm": camera.held_out_rms_mm,
                    "alpha_y": camera.alpha_y,
                    "alpha_z": camera.alpha_z,
                    "centre_px": camera.centre_px,
                    "scale_px": camera.scale_px,
                    "orders": [asdict(trial) for trial in trials if trial.camera == camera.camera],
                }
                for camera in calibration.cameras
            ]
        )
        return
    rows = [
        [
            str(trial.camera),
            str(trial.order),
            str(trial.unknowns),
            str(trial.points),
            _number(trial.rms_mm),
            _number(trial.held_out_rms_mm),
            "chosen" if trial.status == "chosen" else trial.remark,
        ]
        for trial in trials
    ]
    columns = ["camera", "order", "unknowns", "points", "own rms mm", "held-out rms mm", ""]
    print_table("Polynomials in normalised coordinates", columns, rows)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"

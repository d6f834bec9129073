"""`footscan calibrate chart` and `footscan calibrate models`."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from pipelines.cli.calibrate.file import tell_calibration, write_calibration
from pipelines.cli.terminal.output import AsJson, keep_inputs, message, print_json, print_line, print_table, print_text
from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from footscan.calibration.chart.chart import Chart
    from footscan.calibration.chart.checks import ChartWarning
    from footscan.calibration.models.selection import ModelTrial
    from schemas.calibration import Calibration

ChartFile = Annotated[Path, typer.Argument(help="CSV: camera,point,x_mm,y_mm,z_mm,i,j (or x_cm, y_cm, z_cm).")]
KeepGoing = Annotated[
    bool,
    typer.Option("--keep-going", help="Continue when points of the chart are suspicious; they are still reported."),
]


def chart(
    file: ChartFile,
    model: Annotated[
        Literal["auto", "quadratic", "polynomial", "homography", "homography-distortion", "homography-correction"],
        typer.Option(help="auto: smallest error on held-out points; quadratic: the model of the thesis."),
    ] = "auto",
    order: Annotated[
        int | None, typer.Option(min=1, max=5, help="Order of the polynomial; default: chosen on held-out data.")
    ] = None,
    points: Annotated[
        int | None,
        typer.Option(min=4, max=2000, help="Control points of each camera to use, the most spread ones; default: all."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Calibration file to write.")] = None,
    keep_going: KeepGoing = False,
    as_json: AsJson = False,
) -> None:
    """Calibrate from a chart of control points with known pixels."""
    from footscan.calibration.chart.chart import most_spread
    from footscan.calibration.chart.from_chart import calibrate_chart
    from pipelines.cli.calibrate.model_table import print_trials
    from pipelines.engine.files.digest import sha256
    from pipelines.version import SOFTWARE
    from schemas.calibration import Source
    from schemas.parameters.calibration import CalibrationParameters

    if order is not None and model != "polynomial":
        raise RefusedInput("--order", "goes with --model polynomial alone")
    keep_inputs([out], file)
    charts, warnings = _checked(file, keep_going=keep_going)
    if points is not None:
        charts = {view: most_spread(own, points) for view, own in charts.items()}
    try:
        calibration, trials = calibrate_chart(
            charts,
            parameters=CalibrationParameters(model=model, order=order),
            source=Source(name=file.name, sha256=sha256(file.read_bytes())),
            software=SOFTWARE,
        )
    except RefusedInput as refused:  # which knows the chart by its name alone, as the calibration does
        raise RefusedInput(file, refused.problem, field=refused.field) from None
    _tell(file, warnings)
    write_calibration(calibration, out)
    if model == "quadratic":
        _print_quadratic(charts, as_json=as_json)
    elif as_json:
        print_json(_calibration_json(charts, calibration, trials, warnings))
    else:
        print_trials(trials)
    tell_calibration(calibration, out)


def models(
    file: ChartFile,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print the table as Markdown.")] = False,
    keep_going: KeepGoing = False,
    as_json: AsJson = False,
) -> None:
    """Compare all models on a chart, on fitted and on held-out points; writes nothing."""
    from footscan.calibration.chart.from_chart import compare_models
    from pipelines.cli.calibrate.model_table import markdown_of_models, print_models

    charts, warnings = _checked(file, keep_going=keep_going)
    trials = [trial for chart in charts.values() for trial in compare_models(chart, str(file))]
    _tell(file, warnings)
    if as_json:
        print_json(
            [
                {"camera": camera, "models": _trials_json(chart, trials), "warnings": _warnings_json(warnings, camera)}
                for camera, chart in charts.items()
            ]
        )
    elif markdown:
        print_text(markdown_of_models(trials))
    else:
        print_models(trials)


def _checked(file: Path, *, keep_going: bool) -> "tuple[dict[int, Chart], list[ChartWarning]]":
    """The charts of a file and warnings about its points; refuses certain mistakes."""
    from footscan.calibration.chart.chart import read_chart
    from footscan.calibration.chart.checks import check_charts, refuse_mistakes

    charts = read_chart(file)
    warnings = check_charts(charts)
    if not keep_going:
        refuse_mistakes(warnings, file)
    return charts, warnings


def _tell(file: Path, warnings: "list[ChartWarning]") -> None:
    for warning in warnings:
        message(f"{file.name}: {warning}")


def _calibration_json(
    charts: "dict[int, Chart]",
    calibration: "Calibration",
    trials: "list[ModelTrial]",
    warnings: "list[ChartWarning]",
) -> list[dict[str, Any]]:
    documents = []
    for camera in calibration.cameras:
        own = [trial for trial in trials if trial.camera == camera.view]
        chosen = next((trial for trial in own if trial.status == "chosen"), own[0])
        documents.append(
            {
                "camera": camera.camera,
                **({} if camera.laser == 1 else {"laser": camera.laser, "ahead_mm": camera.ahead_mm}),
                "model": chosen.model,
                "unknowns": chosen.unknowns,
                "points": camera.points,
                "rms_mm": camera.rms_mm,
                "held_out_rms_mm": camera.held_out_rms_mm,
                "worst_mm": camera.worst_mm,
                "map": camera.map.model_dump(mode="json"),
                "models": _trials_json(charts[camera.view], own),
                "warnings": _warnings_json(warnings, camera.camera),
            }
        )
    return documents


def _trials_json(chart: "Chart", trials: "list[ModelTrial]") -> list[dict[str, Any]]:
    """The trials of one camera as JSON, with the name of the worst point."""
    documents = [asdict(trial) for trial in trials if trial.camera == chart.view]
    for document in documents:
        worst = document["worst_point"]
        document["worst_point"] = None if worst is None else chart.points[worst]
    return documents


def _warnings_json(warnings: "list[ChartWarning]", camera: int) -> list[dict[str, Any]]:
    return [asdict(warning) for warning in warnings if warning.camera == camera]


def _print_quadratic(charts: "dict[int, Chart]", *, as_json: bool) -> None:
    from footscan.calibration.chart.quadratic import fit_quadratic

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
        print_line(remark)

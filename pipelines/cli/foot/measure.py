"""`footscan measure`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pipelines.cli.terminal.output import AsJson, figure, keep_inputs, message, print_json, print_line, print_table
from schemas.base.errors import Finding, RefusedInput

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from footscan.measure.bodies.raw_mesh import MeshUnit, RawMesh
    from schemas.base.model import Side
    from schemas.measures import Axis, Measures


DECIMALS = {"mm": 2, "mm2": 0, "mm3": 0, "deg": 1, "1": 3}
"""Decimals of a printed measure, by unit."""


def measure(
    file: Annotated[Path, typer.Argument(help="Mesh of a foot, in any pose: STL, PLY or OBJ.")],
    side: Annotated[
        Literal["right", "left", "unknown"], typer.Option(help="Side of the foot; default: inferred from its shape.")
    ] = "unknown",
    posture: Annotated[
        Literal["sitting", "half_weight", "standing", "unknown"],
        typer.Option(help="Posture of the person and load on the foot, for measures.json."),
    ] = "unknown",
    axis: Annotated[
        Literal["toe2", "ball_center", "brannock"], typer.Option(help="Foot axis along which lengths are measured.")
    ] = "toe2",
    unit: Annotated[
        Literal["mm", "cm", "m", "in"] | None,
        typer.Option(help="Unit of the mesh; default: inferred from the size of a foot."),
    ] = None,
    landmarks: Annotated[
        Path | None, typer.Option(help="Landmarks set by hand (YAML), in mm in the frame of the mesh.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="measures.json to write.")] = None,
    csv: Annotated[
        Path | None, typer.Option(help="CSV to write the values to; a row is appended to an existing table.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Picture to write: the foot with landmarks, axis and girths (PNG).")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure the mesh of a foot, or of both feet, from this scanner or another.

    Of both feet, --out and --picture write a file each, with -left and -right in its name.
    """
    keep_inputs((out, csv, picture), file)
    if picture is not None and picture.suffix.lower() != ".png":
        raise RefusedInput("--picture", f"expected a name that ends with .png, found {picture.name!r}")
    feet = _measured(file, side, axis, unit, landmarks)
    measured = [(mesh, measures.model_copy(update={"posture": posture})) for mesh, measures in feet]
    for note in dict.fromkeys(note for mesh, _ in measured for note in mesh.notes):
        message(f"{file}: {note}")
    for mesh, measures in measured:
        suffix = f"-{measures.side}" if len(measured) > 1 else ""
        for note in measures.warnings:
            message(f"{file}: {note}")
        files = [None if path is None else path.with_stem(path.stem + suffix) for path in (out, picture)]
        _write(file, mesh, measures, files[0], csv, files[1])
    if as_json:
        documents = [measures.model_dump(mode="json") for _, measures in measured]
        print_json(documents[0] if len(documents) == 1 else dict(zip(("left", "right"), documents, strict=True)))
    else:
        for _, measures in measured:
            print_measures(measures, {})


def _measured(
    file: Path, side: "Side", axis: "Axis", unit: "MeshUnit | None", landmarks: Path | None
) -> "list[tuple[RawMesh, Measures]]":
    """Measure the one or two feet of a mesh; of two, the left one comes first."""
    from footscan.measure.bodies.raw_mesh import prepare_feet
    from footscan.measure.foot_landmarks import check_manual
    from footscan.measure.partial import measure_pair, measure_raw
    from footscan.mesh.formats.files import read_mesh

    manual = {} if landmarks is None else _manual_landmarks(landmarks)
    vertices, faces = read_mesh(file)
    try:
        feet = prepare_feet(vertices, faces, unit)
        if len(feet) == 2:
            pair = measure_pair((feet[0], feet[1]), axis)
            if side != "unknown" or landmarks is not None:
                raise RefusedInput(file, "the surface holds two feet, expected one with --side or --landmarks")
            return [pair["left"], pair["right"]]
        if landmarks is not None:
            try:
                check_manual(manual, feet[0].vertices)
            except ValueError as error:
                raise RefusedInput(landmarks, str(error)) from None
        return [(feet[0], measure_raw(feet[0], side, axis, manual))]
    except Finding as error:
        raise RefusedInput(file, str(error)) from None


def _write(
    file: Path, mesh: "RawMesh", measures: "Measures", out: Path | None, csv: Path | None, picture: Path | None
) -> None:
    """Write the files of one foot."""
    from pipelines.engine.files.atomic import write_atomically

    if out is not None:
        write_atomically(out, (measures.model_dump_json(indent=2) + "\n").encode())
    if csv is not None:
        write_atomically(csv, _with_row(csv, file, measures).encode())
    if picture is not None:
        from footscan.report.scan.measure_figure import measure_figure

        write_atomically(picture, measure_figure(mesh.vertices, mesh.faces, measures))


def _manual_landmarks(file: Path) -> "dict[str, NDArray[np.float64]]":
    import numpy as np

    from schemas.base.yaml_files import read_yaml
    from schemas.landmarks import ManualLandmarks

    return {name: np.array(point) for name, point in read_yaml(file, ManualLandmarks).points().items()}


def _with_row(table: Path, file: Path, measures: "Measures") -> str:
    """The CSV `table` with a row for one foot, in place of one that it has for the same file and side; a value is empty
    where it could not be taken."""
    from schemas.tables import csv_text, plain_cell, read_records

    header = ["file", "side", "axis", *(f"{name}_{m.unit}" for name, m in measures.measures.items())]
    row = [plain_cell(str(file)), measures.side, measures.axis, *(m.value for m in measures.measures.values())]
    there = [cells for _, cells in read_records(table)] if table.exists() else []
    if there and there[0] != header:
        raise RefusedInput(table, "has another header, expected rows of measures to add one to", field="line 1")
    return csv_text([header, *(cells for cells in there[1:] if cells[:2] != row[:2]), row])


def print_measures(measures: "Measures", known: dict[str, float]) -> None:
    """Print a table of measures, with the known values if there are any."""
    rows = []
    for name, measured in measures.measures.items():
        value = "-" if measured.value is None else f"{measured.value:.{DECIMALS[measured.unit]}f}"
        row = [name, value, figure(measured.uncertainty, f".{DECIMALS[measured.unit]}f"), measured.unit]
        if known:
            true = known.get(name)
            row.append("-" if true is None else f"{true:.2f}")
            row.append("-" if true is None or measured.value is None else f"{measured.value - true:+.2f}")
        rows.append([*row, measured.status])
    columns = ["measure", "value", "sd", "unit", *(["known", "difference"] if known else []), "status"]
    print_table(f"Foot, side {measures.side}, posture {measures.posture}, axis {measures.axis}", columns, rows)
    for name, measured in measures.measures.items():
        if measured.status != "ok" and measured.note is not None:
            print_line(f"{name} is {measured.status}: {measured.note}")

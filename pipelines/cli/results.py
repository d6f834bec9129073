"""`footscan measure`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pipelines.cli.output import AsJson, print_json, print_table
from schemas.errors import Finding, RefusedInput

if TYPE_CHECKING:
    from schemas.measures import Measures


def measure(
    file: Annotated[Path, typer.Argument(help="Mesh of a foot in millimetres: STL, PLY or OBJ.")],
    side: Annotated[Literal["right", "left", "unknown"], typer.Option(help="Which foot it is.")] = "unknown",
    out: Annotated[Path | None, typer.Option(help="Write measures.json here.")] = None,
    as_json: AsJson = False,
) -> None:
    """Measure a foot's mesh."""
    from footscan.measure.basic import measure_foot
    from footscan.surface.export import read_mesh
    from pipelines.engine.atomic import write_atomically

    vertices, faces = read_mesh(file)
    try:
        measures = measure_foot(vertices, faces, side)
    except Finding as error:
        raise RefusedInput(file, str(error)) from None
    if out is not None:
        write_atomically(out, (measures.model_dump_json(indent=2) + "\n").encode())
    if as_json:
        print_json(measures.model_dump(mode="json"))
    else:
        print_measures(measures, {})


def print_measures(measures: "Measures", known: dict[str, float]) -> None:
    """A table of measures, beside the known values where there are any."""
    rows = []
    for name, measured in measures.measures.items():
        value = "-" if measured.value is None else f"{measured.value:.2f}"
        row = [name, value, measured.unit]
        if known:
            true = known.get(name)
            row.append("-" if true is None else f"{true:.2f}")
            row.append("-" if true is None or measured.value is None else f"{measured.value - true:+.2f}")
        rows.append([*row, measured.status])
    columns = ["measure", "value", "unit", *(["known", "difference"] if known else []), "status"]
    print_table(f"Foot, side {measures.side}", columns, rows)

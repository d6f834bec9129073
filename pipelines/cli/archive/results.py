"""`footscan results`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.archive.selecting import WORKFLOW, WorkflowFile
from pipelines.cli.terminal.output import AsJson, figure, note, print_json, print_table
from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.results.query import ResultsTable, Statistics
    from schemas.tables import Cell

SHOWN = ("scan", "status", "side", "date", "foot_length_mm", "foot_breadth_mm", "ball_girth_mm")
"""Columns that are printed unless others are named."""
SUMMED_UP = SHOWN[4:]
"""Measures of which statistics are printed unless others are named."""
MARKS = {"uncertain": " ?"}
"""What follows a value of each status."""
MOST_COLUMNS = 10
"""Columns of a printed table; of more, each scan has a table of its own."""


def results(
    workflow: WorkflowFile = None,
    folder: Annotated[
        Path | None, typer.Option("--results", help="Folder with results.parquet, instead of a workflow's.")
    ] = None,
    where: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CONDITION",
            help="Rows that are taken, such as side=left, 'foot_length_mm>=260' or warnings~camera; may be repeated.",
        ),
    ] = None,
    sort: Annotated[
        str | None, typer.Option(metavar="COLUMN", help="Sort by this column; -COLUMN: the largest first.")
    ] = None,
    columns: Annotated[
        str | None, typer.Option(metavar="NAME,NAME", help="Columns to show, or 'all'; a unit may be left out.")
    ] = None,
    by: Annotated[
        str | None, typer.Option(metavar="NAME,NAME", help="Statistics by these columns, such as side,sex,age_group.")
    ] = None,
    stats: Annotated[
        bool, typer.Option("--stats", help="Statistics over all rows: number, mean, sd, percentiles 5, 50 and 95.")
    ] = False,
    with_uncertain: Annotated[
        bool, typer.Option("--with-uncertain", help="Let values that are not ok take part in statistics.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="File to write the rows to: .csv or .parquet.")] = None,
    page: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="Page to write: any measure against another, with links to reports."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Filter, sort and sum up the table of an archive's results, and plot it."""
    from pipelines.results.query import Condition, known_column, read_results, select, statistics

    place = folder if folder is not None else _results_of(workflow)
    whole = read_results(place)
    table = select(whole, [Condition.parse(text, whole) for text in where or []], sort)
    named = (
        None if columns is None or columns == "all" else [known_column(n, whole, "--columns") for n in _names(columns)]
    )
    if page is not None:
        _write_page(table, place, page, named)
    if out is not None:
        _write_rows(table, named, out)
    if by is not None or stats:
        groups = [known_column(name, whole, "--by") for name in _names(by or "")]
        measures = named or [name for name in SUMMED_UP if name in whole.columns]
        wrong = [name for name in measures if name not in whole.units]
        if wrong:
            raise RefusedInput("--columns", f"{wrong[0]} holds no numbers, expected measures for statistics")
        _print_statistics(statistics(table, measures, groups, with_uncertain=with_uncertain), groups, as_json)
        return
    if page is not None or out is not None:
        return
    shown = list(whole.columns) if columns == "all" else named or _usual(table)
    if as_json:
        print_json([{name: row.get(name) for name in shown} for row in table.rows])
        return
    cells = [[_cell(row, name, table) for name in shown] for row in table.rows]
    if len(shown) > MOST_COLUMNS:
        for row in cells:
            print_table("", ["column", "value"], list(zip(shown, row, strict=True)))
    else:
        print_table("", shown, cells)
    mark = "; ? is uncertain, see its warnings" if any(cell.endswith(" ?") for row in cells for cell in row) else ""
    note(f"{len(table.rows)} of {len(whole.rows)} scans{mark}")


def _usual(table: "ResultsTable") -> list[str]:
    """The columns that are printed unless others are named; with the problems of scans that failed."""
    failed = any(row.get("problem") is not None for row in table.rows)
    return [name for name in (*SHOWN, *(["problem"] if failed else [])) if name in table.columns]


def _results_of(workflow: Path | None) -> Path:
    from pipelines.archive.workflow_file import read_workflow

    path = workflow or WORKFLOW
    return path.resolve().parent / read_workflow(path).results


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _cell(row: "dict[str, Cell]", name: str, table: "ResultsTable") -> str:
    from pipelines.results.query import STATUS, stem_of

    cell = row.get(name)
    if cell is None:
        return "-" if row.get(f"{stem_of(name, table)}{STATUS}") == "incomplete" and name in table.units else ""
    mark = MARKS.get(str(row.get(f"{stem_of(name, table)}{STATUS}", "ok")), "") if name in table.units else ""
    return (f"{cell:.1f}" if isinstance(cell, float) and table.units.get(name) != "1" else str(cell)) + mark


def _print_statistics(found: "Sequence[Statistics]", groups: Sequence[str], as_json: bool) -> None:
    from pipelines.results.query import PERCENTILES

    if as_json:
        print_json(
            [
                {
                    **dict(zip(groups, one.group, strict=True)),
                    **{name: value for name, value in one._asdict().items() if name not in ("group", "percentiles")},
                    **{f"p{share}": value for share, value in zip(PERCENTILES, one.percentiles, strict=True)},
                }
                for one in found
            ]
        )
        return
    percentiles = [f"p{share}" for share in PERCENTILES]
    rows = [
        [
            *("-" if part is None else str(part) for part in one.group),
            one.measure,
            str(one.number),
            str(one.left_out),
            figure(one.mean, ".2f"),
            figure(one.sd, ".2f"),
            *(figure(value, ".1f") for value in one.percentiles),
        ]
        for one in found
    ]
    print_table("", [*groups, "measure", "n", "left out", "mean", "sd", *percentiles], rows)
    note("left out: values that are not ok; --with-uncertain takes them")


def _write_rows(table: "ResultsTable", named: list[str] | None, out: Path) -> None:
    from pipelines.archive.table import table_bytes
    from pipelines.engine.files.atomic import write_atomically

    if out.suffix not in (".csv", ".parquet"):
        raise RefusedInput(out, f"expected a name that ends in .csv or .parquet, found {out.suffix!r}")
    columns = named or [name for name in table.columns if name != "age_group"]
    write_atomically(out, table_bytes(columns, table.rows, out.suffix))
    note(f"{out}: {len(table.rows)} row{'s' * (len(table.rows) != 1)}")


def _write_page(table: "ResultsTable", results_folder: Path, page: Path, named: list[str] | None) -> None:
    from pipelines.engine.files.atomic import write_atomically
    from pipelines.results.page import points_page

    if page.suffix != ".html":
        raise RefusedInput("--page", f"expected a name that ends in .html, found {page.name!r}")
    first = [name for name in named or SUMMED_UP if name in table.units]
    write_atomically(page, points_page(table, results_folder, page, first).encode())
    note(f"{page}: {len(table.rows)} scan{'s' * (len(table.rows) != 1)}")

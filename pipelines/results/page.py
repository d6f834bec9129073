"""The page of points from a table of results."""

import os
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from footscan.report.archive.plot import PlotColumn, plot_page
from pipelines.results.query import ResultsTable, is_trusted, measures_of
from schemas.base.errors import RefusedInput

GROUPS = ("side", "sex", "age_group", "scanner", "posture", "status", "calibration_file")
"""Columns of texts by which points may be coloured, where they differ."""
OTHERS = ("age",)
"""Columns of numbers that are no measures and may be an axis."""


def points_page(table: ResultsTable, results: Path, page: Path, first: Sequence[str]) -> str:
    """Return the page for a file at `page`; `first` are the axes at the start.

    Raises
    ------
    RefusedInput
        No row has a measure.
    """
    others = [name for name in OTHERS if any(row.get(name) is not None for row in table.rows)]
    names = list(dict.fromkeys([*first, *measures_of(table), *others]))
    if not names or not table.rows:
        raise RefusedInput(results, "has no scan that meets the conditions and has measures, expected one")
    columns = [
        PlotColumn(
            name,
            table.units.get(name, "1"),
            [float(cell) if isinstance(cell := row.get(name), int | float) else None for row in table.rows],
            [is_trusted(row, name, table) for row in table.rows],
        )
        for name in names
    ]
    groups = {name: [str(row.get(name) or "") for row in table.rows] for name in GROUPS if name in table.columns}
    groups = {name: values for name, values in groups.items() if len(set(values)) > 1}
    scans = [str(row.get("scan")) for row in table.rows]
    reports = [_address(results / scan / "report.html", page) for scan in scans]
    return plot_page(scans, reports, columns, groups)


def _address(report: Path, page: Path) -> str | None:
    if not report.is_file():
        return None
    return quote(Path(os.path.relpath(report.resolve(), page.resolve().parent)).as_posix())

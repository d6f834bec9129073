"""Tables of lasts: CSV files with one last per row."""

import difflib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import get_args

from schemas.base.errors import RefusedInput
from schemas.base.limits import refuse_beyond
from schemas.lasts import Last, LastMeasure, LastSide
from schemas.tables import finite, read_records

MEASURES: tuple[LastMeasure, ...] = get_args(LastMeasure)
REQUIRED = ("length_mm", "ball_girth_mm")
RANGES_MM: dict[str, tuple[float, float]] = {
    **{f"{name}_mm": (80.0, 600.0) for name in MEASURES},
    "length_mm": (80.0, 450.0),
    "ball_length_mm": (50.0, 350.0),
    "heel_height_mm": (0.0, 200.0),
    "toe_spring_mm": (0.0, 100.0),
}
"""Columns of numbers and the ranges accepted as mm: a last in cm or inches lies outside. Chosen by hand."""
TEXTS = ("last", "article", "size", "fullness", "side")
COLUMNS = (*TEXTS, *RANGES_MM)


def read_lasts(place: Path) -> list[Last]:
    """Read all lasts in the CSV files of a folder and the folders below it, or in one file, sorted by file name.

    Raises
    ------
    RefusedInput
        There is no last, a last is listed twice, or a cell is not valid; the message names file, row, column and
        expectation in one line.
    """
    files = [place] if place.is_file() else sorted(file for file in place.rglob("*") if file.suffix.lower() == ".csv")
    if not place.exists():
        raise RefusedInput(place, "no such folder, expected one with CSV files of lasts")
    lasts: dict[tuple[str | None, ...], Last] = {}
    for file in files:
        for last in _lasts_of(file):
            key = (last.name, last.article, last.size, last.fullness, last.side)
            if key in lasts:
                raise RefusedInput(
                    last.place, f"last {last.name!r} is listed in {lasts[key].place} already, expected once"
                )
            lasts[key] = last
            refuse_beyond("lasts", len(lasts), place)
    if not lasts:
        raise RefusedInput(place, "no lasts here, expected CSV files with one last per row")
    return list(lasts.values())


def _lasts_of(file: Path) -> Iterator[Last]:
    records = read_records(file)
    line, header = next(records, (1, []))
    _check_header(file, line, header)
    rows = list(records)
    for line, cells in rows:
        if len(cells) != len(header):
            raise RefusedInput(file, f"expected {len(header)} cells, found {len(cells)}", field=f"row {line}")
        yield _last(file, line, dict(zip(header, cells, strict=True)), alone=len(rows) == 1)


def _check_header(file: Path, line: int, header: Sequence[str]) -> None:
    for separator, name in ((";", "';'"), ("\t", "tabs")):
        if len(header) == 1 and separator in header[0]:
            problem = f"cells are separated by {name}, expected ',' between them and a decimal point in numbers"
            raise RefusedInput(file, problem, field=f"row {line}")
    for index, column in enumerate(header):
        if column in header[:index]:
            raise RefusedInput(file, "is listed twice, expected each column once", field=f"row {line}, column {column}")
        if column not in COLUMNS:
            near = difflib.get_close_matches(column, COLUMNS, n=1)
            instead = f"did you mean {near[0]!r}?" if near else f"expected some of {', '.join(COLUMNS)}"
            raise RefusedInput(file, f"unknown column {column[:80]!r}, {instead}", field=f"row {line}")
    missing = [column for column in REQUIRED if column not in header]
    if missing:
        raise RefusedInput(file, f"column {missing[0]} is missing, expected it in the header", field=f"row {line}")


def _last(file: Path, line: int, row: dict[str, str], *, alone: bool) -> Last:
    """The last of one row; a last that is `alone` in its file may take its name from the file."""
    numbers = {column: _number(file, line, column, row.get(column, "")) for column in RANGES_MM}
    texts = {column: row.get(column) or None for column in TEXTS}
    parts = [part for part in (texts["article"], texts["size"], texts["fullness"]) if part]
    name = texts["last"] or " ".join(parts) or (file.stem if alone else None)
    if name is None:
        raise RefusedInput(file, "has no name, expected one in column last, or an article", field=f"row {line}")
    measures: dict[LastMeasure, float] = {
        measure: value for measure in MEASURES if (value := numbers[f"{measure}_mm"]) is not None
    }
    return Last(
        name=name,
        article=texts["article"],
        size=texts["size"],
        fullness=texts["fullness"],
        side=_side(file, line, texts["side"]),
        heel_height_mm=numbers["heel_height_mm"],
        toe_spring_mm=numbers["toe_spring_mm"],
        measures=measures,
        place=f"{file}: row {line}",
    )


def _number(file: Path, line: int, column: str, cell: str) -> float | None:
    if not cell and column not in REQUIRED:
        return None
    low, high = RANGES_MM[column]
    value = finite(cell)
    if not low <= value <= high:
        raise RefusedInput(
            file, f"expected mm from {low:g} to {high:g}, found {cell[:80]!r}", field=f"row {line}, column {column}"
        )
    return value


def _side(file: Path, line: int, cell: str | None) -> LastSide:
    for side in get_args(LastSide):
        if (cell or "both").lower() == side:
            valid_side: LastSide = side
            return valid_side
    raise RefusedInput(file, f"expected left, right or both, found {cell!r}", field=f"row {line}, column side")

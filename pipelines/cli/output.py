"""What the command prints: tables for persons and JSON for programs on standard output, messages on standard error."""

import json
import os
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from schemas.errors import RefusedInput

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of a table.")]


def message(text: str) -> None:
    """A line for the person at the terminal; where that is gone, nobody can read it."""
    with suppress(OSError):
        print(text, file=sys.stderr)


def drop_unwritten() -> None:
    """Keeps what a terminal or a pipe that is gone did not take from changing the exit status."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)


def keep_inputs(outputs: Iterable[Path | None], *inputs: Path) -> None:
    """Refuses outputs that would overwrite an input, or each other.

    Raises
    ------
    RefusedInput
        There is one.
    """
    named: set[str] = set()
    for output in outputs:
        if output is None:
            continue
        place = os.path.realpath(output)  # unlike Path's, it bears links that lead in a circle
        if place in named:
            raise RefusedInput(output, "stands for two outputs, expected a file for each")
        named.add(place)
        if not output.exists():
            continue
        if output.is_dir():
            raise RefusedInput(output, "is a folder, expected the name of a file to write")
        if output.resolve() in {source.resolve() for source in inputs}:
            raise RefusedInput(output, "is an input, expected another file to write")


def print_json(value: Any) -> None:
    """One JSON document on standard output."""
    print(json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False))


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table on standard output; columns whose every cell is a number stand to the right."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(width=None if sys.stdout.isatty() else 120)
    if title:
        console.print(Text(title, style="bold"))
    table = Table()
    for index, column in enumerate(columns):
        numbers = all(_is_number(row[index]) for row in rows)
        table.add_column(column, justify="right" if numbers else "left")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))  # Text: names of scans are data, never markup
    console.print(table)


def figure(value: float | None, form: str = ".3f") -> str:
    """A cell of a table; a dash where the value is not known."""
    return "-" if value is None else format(value, form)


def _is_number(cell: str) -> bool:
    try:
        float(cell or "0")
    except ValueError:
        return cell == "-"
    return True

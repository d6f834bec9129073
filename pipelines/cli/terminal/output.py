"""Output of the command: tables or JSON on standard output, messages on standard error.

Names of folders and all else that comes from outside is shown, never obeyed by the terminal: it cannot move the cursor,
begin a line of its own or hide what stands before it. So nothing here is printed by `print` itself.
"""

import json
import logging
import os
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from schemas.base.errors import RefusedInput, printable

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of a table.")]


def message(text: str) -> None:
    """Print a line on standard error; ignored when the terminal is gone."""
    with suppress(OSError):
        print(printable(text), file=sys.stderr)


def note(text: str) -> None:
    """Print a line on standard error that says what happens or was done, unless the user asked for quiet."""
    if not _quiet:
        message(text)


def be_quiet(*, is_asked: bool = True) -> None:
    """Print no notes and no progress from now on; or print them again."""
    _quiet[:] = [True] if is_asked else []


def is_quiet() -> bool:
    """Return True if the user asked for quiet."""
    return bool(_quiet)


_quiet: list[bool] = []


def drop_unwritten() -> None:
    """Discard output that a closed terminal or pipe did not take, so that it does not change the exit status."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)


def print_line(text: str) -> None:
    """Print a line on standard output."""
    print(printable(text))


def print_text(text: str) -> None:
    """Print text with its line ends on standard output: a table in another format, or a file as it is."""
    print(printable(text, keep="\n\t"), end="")


class LogFormatter(logging.Formatter):
    """Formatter of log lines for the terminal."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 (a name of logging's)
        """The line, with unprintable characters of names escaped."""
        return printable(super().formatMessage(record))

    def formatException(self, ei: Any) -> str:  # noqa: N802 (as above)
        """The lines of a traceback, escaped likewise."""
        return printable(super().formatException(ei), keep="\n")


def keep_inputs(outputs: Iterable[Path | None], *inputs: Path) -> None:
    """Refuse outputs that would overwrite an input or each other.

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
    """Print one JSON document on standard output."""
    print(json_text(value, indent=2))


def json_text(value: Any, indent: int | None = None) -> str:
    """A JSON document, in which invisible characters, such as marks of the writing direction, are escaped."""
    text = json.dumps(value, indent=indent, allow_nan=False, ensure_ascii=False)
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] for c in text)


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table on standard output; columns of numbers are aligned to the right."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(width=None if sys.stdout.isatty() else 120)
    if title:
        console.print(Text(printable(title), style="bold"))
    table = Table()
    for index, column in enumerate(columns):
        numbers = all(_is_number(row[index]) for row in rows)
        table.add_column(Text(printable(column)), justify="right" if numbers else "left")
    for row in rows:
        table.add_row(*(Text(printable(cell, keep="\n")) for cell in row))  # Text: names are data, never markup
    console.print(table)


def figure(value: float | None, form: str = ".3f") -> str:
    """A cell of a table; a dash for an unknown value."""
    return "-" if value is None else format(value, form)


def _is_number(cell: str) -> bool:
    try:
        float(cell or "0")
    except ValueError:
        return cell == "-"
    return True

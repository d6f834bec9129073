"""CSV files: read with one clear line per mistake, written so that a spreadsheet shows text and computes none of it."""

import csv
import io
import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from schemas.base.errors import RefusedInput
from schemas.base.limits import read_bounded, refuse_beyond

Cell = str | int | float | None

_BLANK = r"[\s\x00-\x1f\x7f-\xa0\xad\u200b-\u200f\u2028-\u202f\u2060-\u206f\ufeff]"
_FORMULA = re.compile(rf"[\t\r\n]|{_BLANK}*[=+@\-\u2212\uff1d\uff0b\uff0d\uff20]")
"""How a cell begins that a spreadsheet may compute: the last four signs are the wide ones of East Asian keyboards."""
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


def read_records(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and stripped cells of each line of a CSV file that is not blank, the header among them.

    Raises
    ------
    RefusedInput
        The file is missing, too large (see `schemas.base.limits`), or no CSV in UTF-8.
    """
    try:
        content = read_bounded(path, "table_bytes")
        refuse_beyond("table_rows", max(content.count(b"\n"), content.count(b"\r")), path)
        text = content.decode("utf-8-sig")
    except FileNotFoundError:
        raise RefusedInput(path, "no such file") from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise RefusedInput(path, "expected a CSV file in UTF-8", field=f"line {line}") from None
    except (OSError, ValueError) as error:
        raise RefusedInput(path, f"expected a CSV file ({getattr(error, 'strerror', None) or error})") from None
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        for cells in reader:
            stripped = [cell.strip() for cell in cells]
            if any(stripped):
                yield reader.line_num, stripped
    except csv.Error as error:
        raise RefusedInput(path, f"expected a CSV file ({error})", field=f"line {reader.line_num}") from None


def csv_text(rows: Iterable[Iterable[Cell]]) -> str:
    """Rows as CSV. What a spreadsheet would take for a formula bears an apostrophe; numbers stay numbers."""
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows([plain_cell(cell) for cell in row] for row in rows)
    return text.getvalue()


def plain_cell(cell: Cell) -> Cell:
    """A cell that no spreadsheet computes: text that begins like a formula gets an apostrophe before it."""
    if not isinstance(cell, str):
        return cell
    text = cell.replace("\r\n", "\n").replace("\r", "\n")  # which alone would not be quoted, and end the row
    return f"'{text}" if _FORMULA.match(text) and not _NUMBER.fullmatch(text) else text


def finite(text: str) -> float:
    """The number that `text` is; NaN where it is none, or not finite. Words such as `inf` and `1_000` are none."""
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    return value if math.isfinite(value) else math.nan

"""Pixel coordinates out of a CSV file."""

import csv
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schemas.errors import RefusedInput


def read_pixels(path: Path) -> NDArray[np.float64]:
    """(N, 2) columns `i` and `j` of a CSV file, in px; other columns are passed over.

    Raises
    ------
    RefusedInput
        The file or a column is missing, or a value is no finite number.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.DictReader(file, skipinitialspace=True)
            names = [name.strip() for name in rows.fieldnames or []]
            if not {"i", "j"} <= set(names):
                raise RefusedInput(path, f"expected columns i and j, found {','.join(names)[:80]!r}")
            for name in ("i", "j"):
                if names.count(name) > 1:
                    raise RefusedInput(path, f"column {name} stands twice, expected it once", field="line 1")
            rows.fieldnames = names
            pixels = [[_number(path, rows.line_num, name, row[name]) for name in ("i", "j")] for row in rows]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        problem = "no such file" if isinstance(error, FileNotFoundError) else f"expected a CSV file ({error})"
        raise RefusedInput(path, problem) from None
    return np.array(pixels, np.float64).reshape(-1, 2)


def _number(path: Path, line: int, name: str, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RefusedInput(path, f"expected a number of pixels, found {text!r}", field=f"line {line}, column {name}")
    return value

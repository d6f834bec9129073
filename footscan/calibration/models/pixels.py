"""Pixel coordinates out of a CSV file."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schemas.base.errors import RefusedInput
from schemas.tables import finite, read_records

LARGEST_PX = 1e6
"""No pixel of any camera lies farther out; the powers of it that a map takes stay finite."""


def read_pixels(path: Path) -> NDArray[np.float64]:
    """(N, 2) columns `i` and `j` of a CSV file, in px; other columns are passed over.

    Raises
    ------
    RefusedInput
        The file or a column is missing, or a value is no pixel of any camera.
    """
    records = read_records(path)
    _, header = next(records, (1, []))
    for name in ("i", "j"):
        if header.count(name) != 1:
            problem = f"expected columns i and j, each once, found {','.join(header)[:80]!r}"
            raise RefusedInput(path, problem, field="line 1")
    columns = [(name, header.index(name)) for name in ("i", "j")]
    pixels = [[_number(path, line, name, cells[at : at + 1]) for name, at in columns] for line, cells in records]
    return np.array(pixels, np.float64).reshape(-1, 2)


def _number(path: Path, line: int, name: str, cell: list[str]) -> float:
    value = finite(cell[0]) if cell else LARGEST_PX + 1
    if not abs(value) <= LARGEST_PX:
        found = cell[0][:80] if cell else ""
        raise RefusedInput(path, f"expected a number of pixels, found {found!r}", field=f"line {line}, column {name}")
    return value

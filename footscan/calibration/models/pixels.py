"""Reading of pixel coordinates from a CSV file."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schemas.base.errors import RefusedInput
from schemas.tables import finite, read_records

LARGEST_PX = 1e6
"""Largest coordinate of a pixel: beyond any camera, and its powers in a map stay finite."""


def read_pixels(path: Path) -> NDArray[np.float64]:
    """Read the columns `i` and `j` of a CSV file; other columns are ignored.

    Returns
    -------
    (N, 2) float64, px.

    Raises
    ------
    RefusedInput
        The file or a column is missing, or a value is not a pixel of any camera.
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
    """The number in a `cell`, which is empty if the line is too short."""
    value = finite(cell[0]) if cell else LARGEST_PX + 1
    if not abs(value) <= LARGEST_PX:
        text = cell[0][:80] if cell else ""
        raise RefusedInput(path, f"expected a number of pixels, found {text!r}", field=f"line {line}, column {name}")
    return value

"""Where the laser plane stood at each frame."""

import csv
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schemas.errors import RefusedInput
from schemas.scan import Travel

MAX_FRAMES = 1_000_000


def travelled(travel: Travel, frames: int) -> NDArray[np.float64]:
    """(F,) X in mm of each frame of an even travel."""
    return np.asarray(travel.start_mm + travel.step_mm * np.arange(frames), np.float64)


def read_positions(path: Path) -> NDArray[np.float64]:
    """(F,) X in mm of each frame from a CSV with columns frame, x_mm; NaN for frames that it does not name.

    Raises
    ------
    RefusedInput
        The file is missing or breaks this format.
    """
    positions: dict[int, float] = {}
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.DictReader(file, skipinitialspace=True)
            names = [name.strip() for name in rows.fieldnames or []]
            if sorted(names) != ["frame", "x_mm"]:
                raise RefusedInput(path, f"expected the columns frame,x_mm, found {','.join(names)[:80]!r}")
            rows.fieldnames = names
            for row in rows:
                frame, x_mm = _position(path, rows.line_num, row)
                if frame in positions:
                    raise RefusedInput(path, f"frame {frame} stands twice", field=f"line {rows.line_num}")
                positions[frame] = x_mm
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        problem = "no such file" if isinstance(error, FileNotFoundError) else f"expected a CSV file ({error})"
        raise RefusedInput(path, problem) from None
    if not positions:
        raise RefusedInput(path, "expected a row for each frame, found none")
    x = np.full(max(positions) + 1, np.nan)
    x[list(positions)] = list(positions.values())
    return x


def _position(path: Path, line: int, row: dict[str, str | None]) -> tuple[int, float]:
    try:
        frame, x_mm = int(row["frame"] or ""), float(row["x_mm"] or "")
    except ValueError:
        frame, x_mm = -1, math.nan
    if not 0 <= frame < MAX_FRAMES or not math.isfinite(x_mm) or len(row) > 2:  # a decimal comma makes a third column
        raise RefusedInput(path, "expected a frame number from 0 and x_mm in millimetres", field=f"line {line}")
    return frame, x_mm

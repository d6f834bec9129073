"""Where the laser plane stood at each frame."""

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schemas.base.errors import RefusedInput
from schemas.base.limits import refuse_beyond
from schemas.scan import Travel
from schemas.tables import finite, read_records

FARTHEST_MM = 1e5
"""No travel is longer, see `schemas.scan.Travel`."""


def travelled(travel: Travel, frames: int) -> NDArray[np.float64]:
    """(F,) X in mm of each frame of an even travel."""
    return np.asarray(travel.start_mm + travel.step_mm * np.arange(frames), np.float64)


def x_of_frames(travel: bytes | None, positions: bytes | None, frames: int) -> NDArray[np.float64]:
    """X in mm of each frame, from the inputs of a step: an even travel, or else positions; (F,), F >= `frames`.

    Raises
    ------
    RefusedInput
        A frame has no position.
    """
    if positions is None:
        return travelled(Travel.model_validate_json(travel or b""), frames)
    document = json.loads(positions)
    x = np.array(document["x_mm"], np.float64)  # null becomes NaN
    if len(x) < frames or np.isnan(x[:frames]).any():
        raise RefusedInput(document["file"], f"expected a position for each of {frames} frames", field="frame")
    return x


def read_positions(path: Path) -> NDArray[np.float64]:
    """(F,) X in mm of each frame from a CSV with columns frame, x_mm; NaN for frames that it does not name.

    Raises
    ------
    RefusedInput
        The file is missing or breaks this format.
    """
    records = read_records(path)
    _, header = next(records, (1, []))
    if sorted(header) != ["frame", "x_mm"]:
        raise RefusedInput(path, f"expected the columns frame,x_mm, found {','.join(header)[:80]!r}")
    positions: dict[int, float] = {}
    for line, cells in records:
        frame, x_mm = _position(path, line, header, cells)
        if frame in positions:
            raise RefusedInput(path, f"frame {frame} is given twice", field=f"line {line}")
        positions[frame] = x_mm
    if not positions:
        raise RefusedInput(path, "expected a row for each frame, found none")
    x = np.full(max(positions) + 1, np.nan)
    x[list(positions)] = list(positions.values())
    return x


def _position(path: Path, line: int, header: list[str], cells: list[str]) -> tuple[int, float]:
    row = dict(zip(header, cells, strict=False))
    number = row.get("frame", "")
    frame = int(number) if number.isascii() and number.isdecimal() and len(number) < 16 else -1
    x_mm = finite(row.get("x_mm", ""))
    if len(cells) != len(header) or frame < 0 or not abs(x_mm) <= FARTHEST_MM:
        raise RefusedInput(path, "expected a frame number from 0 and x_mm in millimetres", field=f"line {line}")
    refuse_beyond("film_frames", frame + 1, path, field=f"line {line}")
    return frame, x_mm

"""Where the heads were, and when: the log that frames get their positions from."""

import bisect
import math
import threading
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

KEPT = 100_000
"""Entries that are kept: more than an hour at 20 a second."""


class HeadPosition(NamedTuple):
    """One report of the board."""

    seconds: float
    """`time.monotonic()` of the host at which the heads were there: the middle of the time it can have been."""
    x_mm: Triple
    """World X of heads 1, 2, 3, as the firmware counts their steps."""
    uncertain_seconds: float
    """It was at `seconds` give or take this: half the time between query and answer, less what the bytes took."""
    is_moving: bool

    @property
    def seconds_sd(self) -> float:
        """Standard deviation of `seconds`: it was anywhere within its bounds, evenly."""
        return self.uncertain_seconds / math.sqrt(3.0)


class PositionLog:
    """Reports in the order of time; may be read while it grows. Positions are of axes X, Y, Z: heads 1, 2, 3."""

    def __init__(self) -> None:
        self._entries: list[HeadPosition] = []
        self._lock = threading.Lock()

    def add(self, entry: HeadPosition) -> None:
        """Appends a report."""
        with self._lock:
            self._entries.append(entry)
            if len(self._entries) > 2 * KEPT:
                del self._entries[:KEPT]

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[HeadPosition]:
        return iter(self.between(-math.inf, math.inf))

    def between(self, begin: float, end: float) -> list[HeadPosition]:
        """Entries with `begin` <= seconds <= `end`."""
        with self._lock:
            first = bisect.bisect_left(self._entries, begin, key=lambda entry: entry.seconds)
            last = bisect.bisect_right(self._entries, end, key=lambda entry: entry.seconds)
            return self._entries[first:last]

    def arrays(self, begin: float = -math.inf, end: float = math.inf) -> tuple[Floats, Floats, Floats]:
        """Seconds (N,), X of the heads (N, 3) in mm, and standard deviations of the seconds (N,), of that time."""
        entries = self.between(begin, end)
        return (
            np.array([entry.seconds for entry in entries], dtype=np.float64),
            np.array([entry.x_mm for entry in entries], dtype=np.float64).reshape(-1, 3),
            np.array([entry.seconds_sd for entry in entries], dtype=np.float64),
        )

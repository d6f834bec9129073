"""The log of head positions over time, from which frames get their positions."""

import bisect
import math
import threading
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

KEPT = 100_000
"""Number of entries that are kept: more than an hour at 20 a second. A bound of memory."""


class HeadPosition(NamedTuple):
    """One report of the board."""

    seconds: float
    """`time.monotonic()` of the host at this position: the middle of the possible interval."""
    x_mm: tuple[float, ...]
    """World X of heads 1, 2, ... from the step counts of the firmware."""
    uncertain_seconds: float
    """Half the width of that interval: half the time between query and answer, less the transmission of the bytes."""
    is_moving: bool

    @property
    def seconds_sd(self) -> float:
        """Standard deviation of `seconds`, which is uniform within its bounds."""
        return self.uncertain_seconds / math.sqrt(3.0)


class PositionLog:
    """Reports in the order of time; may be read while it grows."""

    def __init__(self) -> None:
        self._entries: list[HeadPosition] = []
        self._lock = threading.Lock()

    def add(self, entry: HeadPosition) -> None:
        """Append a report."""
        with self._lock:
            self._entries.append(entry)
            if len(self._entries) > 2 * KEPT:
                del self._entries[:KEPT]

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[HeadPosition]:
        return iter(self.between(-math.inf, math.inf))

    def between(self, begin: float, end: float) -> list[HeadPosition]:
        """Return the entries with `begin` <= seconds <= `end`."""
        with self._lock:
            first = bisect.bisect_left(self._entries, begin, key=lambda entry: entry.seconds)
            last = bisect.bisect_right(self._entries, end, key=lambda entry: entry.seconds)
            return self._entries[first:last]

    def arrays(self, begin: float = -math.inf, end: float = math.inf) -> tuple[Floats, Floats, Floats]:
        """Return seconds (N,), X of the heads (N, H) in mm, and standard deviations of seconds (N,) in an interval."""
        entries = self.between(begin, end)
        return (
            np.array([entry.seconds for entry in entries], dtype=np.float64),
            np.array([entry.x_mm for entry in entries], dtype=np.float64).reshape(
                len(entries), len(entries[0].x_mm) if entries else 0
            ),
            np.array([entry.seconds_sd for entry in entries], dtype=np.float64),
        )

"""The state of the live scanner, with listeners: commands, pages, tests."""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Literal

from footscan.capture.board.state import BoardState
from schemas.base.errors import FootscanError, RefusedInput

log = logging.getLogger("footscan.live")

Activity = Literal[
    "disconnected", "idle", "preparing", "homing", "filming", "storing", "reconstructing", "done", "failed"
]  # fmt: skip
"""`preparing`: the scanner is reserved for work that needs none of its devices, such as a calculation."""
SETTLED_SECONDS = 5.0
"""Time from which the rate of an activity is known, and shortest time left that is estimated. Chosen by hand."""
StateName = Activity | Literal["door open", "alarm"]


@dataclass(frozen=True)
class ScannerState:
    """One state."""

    name: StateName
    words: str = ""
    """What the scanner does, or why it failed."""
    progress: float | None = None
    """Share of the activity that is done, 0 to 1; None if unknown."""
    left_s: float | None = None
    """Estimated time that is left, s; None where it is short, or unknown."""

    def __str__(self) -> str:
        share = "" if self.progress is None else f" {100 * self.progress:.0f} %"
        left = "" if self.left_s is None else f", about {_in_words(self.left_s)} left"
        return self.name + share + left + (f": {self.words}" if self.words else "")


def _in_words(seconds: float) -> str:
    return f"{10 * round(seconds / 10):.0f} s" if seconds < 95.0 else f"{seconds / 60:.0f} min"


OnState = Callable[[ScannerState], None]


class StateBoard:
    """The state and its listeners. Any thread may read the state; listeners run in the thread that changes it."""

    def __init__(self) -> None:
        self._state = ScannerState("disconnected")
        self._listeners: list[OnState] = []
        self._lock = threading.Lock()
        self._working = threading.Lock()
        self._since = time.monotonic()

    @property
    def state(self) -> ScannerState:
        """The latest state."""
        return self._state

    def listen(self, listener: OnState) -> Callable[[], None]:
        """Call `listener` with each new state; returns a function that ends it."""
        with self._lock:
            self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def tell(self, name: Activity, words: str = "", progress: float | None = None) -> None:
        """Set a new state."""
        with self._lock:
            self._since = time.monotonic()
            self._state = state = ScannerState(name, words, progress)
            listeners = list(self._listeners)
        for listener in listeners:
            listener(state)

    def progress(self, share: float) -> None:
        """Set the progress of the present activity, 0 to 1."""
        with self._lock:
            share = min(max(share, 0.0), 1.0)
            passed = time.monotonic() - self._since
            left_s = passed * (1.0 - share) / share if share > 0.0 and passed > SETTLED_SECONDS else None
            is_long = left_s is not None and left_s > SETTLED_SECONDS
            self._state = state = replace(self._state, progress=share, left_s=left_s if is_long else None)
            listeners = list(self._listeners)
        for listener in listeners:
            listener(state)

    @contextmanager
    def at_work(self, first: Activity, words: str = "") -> Iterator[None]:
        """Reserve the scanner for one activity; a failure becomes the state and is raised to the caller.

        Raises
        ------
        RefusedInput
            The scanner is busy.
        """
        if not self._working.acquire(blocking=False):
            raise RefusedInput("scanner", f"is {self._state.name}, expected it to be idle")
        try:
            self.tell(first, words)
            yield
        except FootscanError as error:
            self.tell("failed", str(error))
            raise
        except (KeyboardInterrupt, SystemExit):
            self.tell("failed", "interrupted")
            raise
        except BaseException as error:
            self.tell("failed", f"{type(error).__name__}: {error}")
            raise
        finally:
            self._working.release()


def with_board(state: ScannerState, board: BoardState | None) -> ScannerState:
    """The state, unless that of the board is more urgent: an open lid, an alarm, a lost connection."""
    if board is None:
        return state
    match board.name:
        case "door":
            return ScannerState("door open", str(board), state.progress)
        case "alarm":
            return ScannerState("alarm", str(board))
        case "lost" | "closed":
            return ScannerState("disconnected", str(board))
    return state

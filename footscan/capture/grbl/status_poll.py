"""Asking the board where it is: often while it moves, seldom while it stands, and when each answer was true."""

import statistics
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from footscan.capture.grbl.report import Report
from footscan.capture.grbl.serial_line import BYTES_PER_SECOND
from schemas.base.errors import Fault

QUERY = b"?"
MOVING_SECONDS, STANDING_SECONDS = 0.05, 0.2
"""Between two queries; the firmware's documentation advises 5 to 20 a second."""
AGAIN_SECONDS = 0.25
"""When a query is repeated that has no answer: a byte may be lost."""
QUIET_SECONDS = 0.2
"""How long nothing is asked after the answer to a repeated query is due: it must not pass for that of the next one."""
LOST_QUERY_SECONDS = 2.0 * AGAIN_SECONDS + QUIET_SECONDS
"""How much longer a report takes where a byte was lost."""
KEPT_ROUND_TRIPS = 200


@dataclass(frozen=True)
class TimedReport:
    """A status report and when it was true."""

    report: Report
    asked: float
    """`time.monotonic()` s of the oldest query that it may answer."""
    seconds: float
    """The middle of the time at which the board can have looked."""
    uncertain_seconds: float
    """It was at `seconds` give or take this."""


class StatusPoll:
    """A thread that asks; answers are handed to `take`."""

    def __init__(
        self, write: Callable[[bytes], float], on_silence: Callable[[], None], patience_seconds: float
    ) -> None:
        """Asks by `write`, and calls `on_silence` where nothing came for `patience_seconds`."""
        self.latest: TimedReport | None = None
        self.rests = False
        """Whether nothing is asked."""
        self.quiet_until = 0.0
        """Before that nothing is asked either."""
        self._write = write
        self._on_silence = on_silence
        self._patience = patience_seconds
        self._asked: float | None = None
        """The oldest query without an answer."""
        self._asked_again = 0.0
        self._round_trips: deque[float] = deque(maxlen=KEPT_ROUND_TRIPS)
        self._wanted = threading.Event()
        self._ends = False
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="status poll", daemon=True)

    @property
    def round_trip_seconds(self) -> float:
        """Median of lately."""
        return statistics.median(self._round_trips) if self._round_trips else float("nan")

    def start(self) -> None:
        """Begins to ask."""
        self._thread.start()

    def close(self) -> None:
        """Ends the thread."""
        self._ends = True
        self._wanted.set()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()

    def ask(self) -> float:
        """Asks at once; a report with `asked` at or after the returned time is an answer to this."""
        now = time.monotonic()
        if not self._thread.is_alive():
            self._query()
        self._wanted.set()
        return now

    @contextmanager
    def resting(self) -> Iterator[None]:
        """Nothing is asked, while the board homes: it would answer all queries by one report at the end of that."""
        self.rests = True
        try:
            yield
        finally:
            with self._lock:
                if self._asked is not None:  # it came too late to be answered before, and is answered now
                    self._asked = None
                    self.quiet_until = time.monotonic() + QUIET_SECONDS
            self.rests = False

    def forget(self) -> None:
        """Discard the latest report and the query under way, because the board restarts."""
        with self._lock:
            self._asked = None
            self.latest = None

    def take(self, report: Report, arrived: float, length: int) -> TimedReport | None:
        """A report of `length` bytes whose last byte came at `arrived`; None where nobody asked for it.

        The board looks at its position between the query and the first byte of the answer. Through a UART the bytes
        take their time at the baud rate, which is taken off; where all came faster than that, there is no UART.
        """
        with self._lock:
            asked, self._asked = self._asked, None
            if asked is not None and self._asked_again != asked:  # its own answer may take as long as this one took
                self.quiet_until = self._asked_again + (arrived - asked) + QUIET_SECONDS
        if asked is None:
            return None
        on_the_way = length / BYTES_PER_SECOND
        latest = arrived - on_the_way if arrived - asked > on_the_way else arrived
        self._round_trips.append(arrived - asked)
        self.latest = TimedReport(report, asked, (asked + latest) / 2.0, (latest - asked) / 2.0)
        return self.latest

    def _run(self) -> None:
        while not self._ends:
            self._wanted.wait(self._interval())
            self._wanted.clear()
            if self._ends:
                return
            if self.rests:
                continue
            try:
                self._ask_or_complain()
            except Fault:
                return  # the line is lost, and has told so

    def _ask_or_complain(self) -> None:
        now = time.monotonic()
        with self._lock:
            asked = self._asked
        if asked is None:
            if now >= self.quiet_until:
                self._query()
        elif now - asked > self._patience:
            self.forget()
            self._on_silence()
        elif now - self._asked_again > AGAIN_SECONDS:
            with self._lock:
                self._asked_again = now
            self._write(QUERY)

    def _query(self) -> None:
        with self._lock:
            self._asked = self._asked_again = time.monotonic()
        self._write(QUERY)

    def _interval(self) -> float:
        standing = self.latest is not None and self.latest.report.state in ("Idle", "Alarm")
        return STANDING_SECONDS if standing else MOVING_SECONDS

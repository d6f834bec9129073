"""Polls the board for status reports, often while it moves and seldom while it stands, and times each answer."""

import statistics
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from footscan import clock
from footscan.capture.grbl.report import Report
from footscan.capture.grbl.serial_line import BYTES_PER_SECOND
from schemas.base.errors import Fault

QUERY = b"?"
MOVING_SECONDS, STANDING_SECONDS = 0.05, 0.2
"""Intervals of queries; Grbl's documentation advises 5 to 20 a second."""
AGAIN_SECONDS = 0.25
"""A query without an answer is repeated after this time: a byte may be lost. Chosen by hand."""
QUIET_SECONDS = 0.2
"""Pause after the answer to a repeated query is due: that answer must not be taken for one of the next query. Chosen
by hand."""
LOST_QUERY_SECONDS = 2.0 * AGAIN_SECONDS + QUIET_SECONDS
"""Extra time of a report if a byte was lost."""
KEPT_ROUND_TRIPS = 200


@dataclass(frozen=True)
class TimedReport:
    """A status report and the time at which it was true."""

    report: Report
    asked: float
    """`clock.seconds()`, s, of the oldest query that it may answer."""
    seconds: float
    """Middle of the interval in which the board can have read its position."""
    uncertain_seconds: float
    """Half the width of that interval."""


class StatusPoll:
    """A thread that sends queries; `take` receives the answers."""

    def __init__(
        self, write: Callable[[bytes], float], on_silence: Callable[[], None], patience_seconds: float
    ) -> None:
        """Send queries by `write`, and call `on_silence` if no report arrives for `patience_seconds`."""
        self.latest: TimedReport | None = None
        self.rests = False
        """True while no queries are sent."""
        self.quiet_until = 0.0
        """No queries are sent before this time, `clock.seconds()`, s."""
        self._write = write
        self._on_silence = on_silence
        self._patience = patience_seconds
        self._asked: float | None = None
        """Time of the oldest query without an answer."""
        self._asked_again = 0.0
        self._round_trips: deque[float] = deque(maxlen=KEPT_ROUND_TRIPS)
        self._wanted = threading.Event()
        self._ends = False
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="status poll", daemon=True)

    @property
    def round_trip_seconds(self) -> float:
        """Median of the latest times between query and answer; NaN before the first."""
        return statistics.median(self._round_trips) if self._round_trips else float("nan")

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._ends = True
        self._wanted.set()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()

    def ask(self) -> float:
        """Send a query at once; a report whose `asked` is at or after the returned time answers it."""
        now = clock.seconds()
        if not self._thread.is_alive():
            self._query()
        self._wanted.set()
        return now

    @contextmanager
    def resting(self) -> Iterator[None]:
        """Send no queries while the board homes: it would answer all of them by one report at the end."""
        self.rests = True
        try:
            yield
        finally:
            with self._lock:
                if self._asked is not None:  # a query that arrived too late for an answer before is answered now
                    self._asked = None
                    self.quiet_until = clock.seconds() + QUIET_SECONDS
            self.rests = False

    def forget(self) -> None:
        """Discard the latest report and the query under way, because the board restarts."""
        with self._lock:
            self._asked = None
            self.latest = None

    def take(self, report: Report, arrived: float, length: int) -> TimedReport | None:
        """Time a report of `length` bytes whose last byte arrived at `arrived`; None if there was no query.

        The board reads its position between the query and the first byte of the answer. The transmission time of the
        bytes at the baud rate is subtracted; if all arrived faster than that, there is no UART.
        """
        with self._lock:
            asked, self._asked = self._asked, None
            if asked is not None and self._asked_again != asked:  # the answer to the repeated query may take as long
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
                return  # the line is lost, and has reported it

    def _ask_or_complain(self) -> None:
        now = clock.seconds()
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
            self._asked = self._asked_again = clock.seconds()
        self._write(QUERY)

    def _interval(self) -> float:
        standing = self.latest is not None and self.latest.report.state in ("Idle", "Alarm")
        return STANDING_SECONDS if standing else MOVING_SECONDS

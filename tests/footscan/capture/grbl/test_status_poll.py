"""When a report was true, on lines that are late or lose bytes."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import count

import pytest
from waiting import wait_until

from footscan.capture.grbl.report import Report
from footscan.capture.grbl.status_poll import StatusPoll, TimedReport

pytestmark = pytest.mark.real_time  # reports are asked for ten times a second

ANSWER = b"<Run|MPos:0.000,0.000,0.000>"
SECONDS = 3.0


class Line:
    """A board that answers every query at once, and a line to the host that is late; X says when the board looked."""

    def __init__(self, late_seconds: float, loses: Callable[[int], bool]) -> None:
        self.taken: list[TimedReport] = []
        self._late, self._loses = late_seconds, loses
        self._numbers = count()
        self._poll = StatusPoll(self._asked, lambda: None, patience_seconds=5.0)

    def run(self) -> None:
        """Polls for a while."""
        self._poll.start()
        time.sleep(SECONDS)
        self._poll.close()

    def _asked(self, _query: bytes) -> float:
        looked = time.monotonic()
        if not self._loses(next(self._numbers)):
            threading.Timer(self._late, self._answer, [looked]).start()
        return looked

    def _answer(self, looked: float) -> None:
        report = Report("Run", None, (looked, 0.0, 0.0))
        if (timed := self._poll.take(report, time.monotonic(), len(ANSWER))) is not None:
            self.taken.append(timed)


CASES = {
    f"{late_seconds} s late, {lost}": (late_seconds, loses)
    for late_seconds in (0.0, 0.1, 0.3, 0.45, 0.7)
    for lost, loses in {"nothing lost": lambda _: False, "every third query lost": lambda k: k % 3 == 1}.items()
}


@pytest.fixture(scope="module")
def reports() -> dict[str, list[TimedReport]]:
    """The reports of each line; all lines are polled at once, because they only wait."""
    lines = {case: Line(*of) for case, of in CASES.items()}
    with ThreadPoolExecutor(len(lines)) as pool:
        list(pool.map(Line.run, lines.values()))
    return {case: line.taken for case, line in lines.items()}


@pytest.mark.parametrize("case", CASES)
def test_a_report_is_never_taken_for_the_answer_to_a_later_query(
    reports: dict[str, list[TimedReport]], case: str
) -> None:
    assert reports[case]
    for timed in reports[case]:
        assert timed.report.machine_mm is not None
        assert abs(timed.seconds - timed.report.machine_mm[0]) <= timed.uncertain_seconds + 0.005


def test_nothing_is_asked_while_it_rests_and_what_was_asked_before_counts_for_nothing() -> None:
    asked: list[float] = []

    def ask(_query: bytes) -> float:
        asked.append(time.monotonic())
        return asked[-1]

    poll = StatusPoll(ask, lambda: None, patience_seconds=0.2)
    poll.start()
    wait_until(lambda: bool(asked))
    with poll.resting():
        time.sleep(1.0)  # longer than patience, and than it takes to ask again
        begun = len(asked)
    ended = time.monotonic()
    assert begun <= 2
    assert poll.take(Report("Home", None, (0.0, 0.0, 0.0)), ended, len(ANSWER)) is None
    poll.ask()
    wait_until(lambda: len(asked) > begun)
    assert asked[begun] - ended > 0.1  # the late answer, on its way, must not pass for that of the next query
    told = poll.take(Report("Idle", None, (0.0, 0.0, 0.0)), time.monotonic(), len(ANSWER))
    assert told is not None
    assert told.asked >= ended
    poll.close()

"""The state says how long a long activity still takes."""

import pytest

from pipelines.cli.live.options import StateTeller
from pipelines.live import state
from pipelines.live.state import StateBoard


@pytest.fixture
def passed(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Seconds that have passed."""
    seconds = [100.0]
    monkeypatch.setattr(state.time, "monotonic", lambda: seconds[0])
    return seconds


def test_the_time_left_follows_from_the_progress(passed: list[float]) -> None:
    board = StateBoard()
    board.tell("filming", "pass 1 of 2", 0.0)
    passed[0] += 4.0
    board.progress(0.1)
    assert board.state.left_s is None  # too soon to say
    passed[0] += 16.0
    board.progress(0.2)
    assert board.state.left_s == pytest.approx(80.0)
    assert str(board.state) == "filming 20 %, about 80 s left: pass 1 of 2"
    passed[0] += 40.0
    board.progress(0.25)
    assert str(board.state) == "filming 25 %, about 3 min left: pass 1 of 2"
    board.progress(0.99)
    assert board.state.left_s is None  # not worth saying
    board.tell("storing")
    assert board.state.left_s is None


def test_a_line_a_tenth_of_what_takes_long(passed: list[float], capsys: pytest.CaptureFixture[str]) -> None:
    board = StateBoard()
    board.listen(StateTeller())
    board.tell("filming", progress=0.0)
    for share in (0.0, 0.05, 0.11, 0.15, 0.22):
        passed[0] += 10.0
        board.progress(share)
    board.tell("storing")
    told = capsys.readouterr().err.splitlines()
    assert told == ["filming", "filming 11 %, about 4 min left", "filming 22 %, about 3 min left", "storing"]

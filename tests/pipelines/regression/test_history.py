"""The history of nights: if a night fails, no line of another night is lost."""

import subprocess
import sys
import threading
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from pipelines.regression.check import age_of, check_last
from pipelines.regression.history import FILE, History, alone, append, gaps, read_history
from schemas.base.errors import Fault, RefusedInput
from schemas.regression import NightBegun, NightEnded

NOON = datetime(2026, 11, 20, 12, tzinfo=UTC)


def begun(name: str, time: datetime = NOON) -> NightBegun:
    return NightBegun(night=name, time=time, software="footscan 0", host="here")


def ended(name: str, time: datetime = NOON) -> NightEnded:
    return NightEnded(night=name, time=time, status=0, sets={"a": {"accuracy.mean_mm": 0.1}})


def test_what_is_appended_is_read(tmp_path: Path) -> None:
    assert read_history(tmp_path) == History()
    for line in (begun("1"), ended("1"), begun("2")):
        append(tmp_path, line)
    assert read_history(tmp_path) == History([begun("1"), begun("2")], [ended("1")], [])
    assert read_history(tmp_path).unfinished == [begun("2")]


@pytest.mark.parametrize("kept", [1, 20, -1])
def test_a_torn_last_line_is_told_and_skipped(tmp_path: Path, kept: int) -> None:
    append(tmp_path, ended("1"))
    whole = (tmp_path / FILE).read_bytes()
    (tmp_path / FILE).write_bytes(whole + whole.replace(b'"1"', b'"2"').strip()[:kept])
    assert (read_history(tmp_path).ended, read_history(tmp_path).damaged) == ([ended("1")], [2])
    append(tmp_path, ended("3"))
    history = read_history(tmp_path)
    assert ([night.night for night in history.ended], history.damaged) == (["1", "3"], [2])


def test_many_at_once_lose_nothing(tmp_path: Path) -> None:
    def many(who: int) -> None:
        for number in range(20):
            append(tmp_path, ended(f"{who}-{number}"))

    threads = [threading.Thread(target=many, args=(who,)) for who in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    history = read_history(tmp_path)
    assert history.damaged == []
    assert {night.night for night in history.ended} == {f"{who}-{n}" for who in range(6) for n in range(20)}


FULL = """
import resource, signal, sys
from pathlib import Path
from pipelines.regression.history import append
from schemas.base.errors import Fault
from schemas.regression import NightEnded
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
folder, limit = Path(sys.argv[1]), int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
line = NightEnded.model_validate_json((folder / "line.json").read_text())
try:
    append(folder, line)
except Fault as fault:
    print(fault)
"""


@pytest.mark.parametrize("room", [0, 10])
def test_a_full_disk_leaves_the_history_as_it_was(tmp_path: Path, room: int) -> None:
    append(tmp_path, ended("1"))
    before = (tmp_path / FILE).read_bytes()
    (tmp_path / "line.json").write_text(ended("2").model_dump_json())
    arguments = [sys.executable, "-c", FULL, str(tmp_path), str(len(before) + room)]
    told = subprocess.run(arguments, capture_output=True, text=True, check=True).stdout
    assert told == f"{tmp_path}/{FILE}: cannot be written (File too large)\n"
    assert (tmp_path / FILE).read_bytes() == before


def test_one_night_at_a_time_and_a_killed_one_holds_nobody_up(tmp_path: Path) -> None:
    with alone(tmp_path), pytest.raises(Fault, match="another night is under way"), alone(tmp_path):
        pass
    code = f"""
import os, signal
from pathlib import Path
from pipelines.regression.history import alone
with alone(Path({str(tmp_path)!r})):
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -9
    with alone(tmp_path):
        pass


def test_nights_that_did_not_run() -> None:
    hours = (0, 24, 49, 96, 120)
    history = History(ended=[ended(str(hour), NOON + timedelta(hours=hour)) for hour in hours])
    assert gaps(history, timedelta(hours=24)) == [(NOON + timedelta(hours=49), NOON + timedelta(hours=96))]
    assert gaps(history, timedelta(hours=48)) == []


def test_the_next_morning(tmp_path: Path) -> None:
    day = timedelta(hours=24)
    assert check_last(tmp_path, day) == (False, f"no night has ended in {tmp_path}, expected one within 24.0 h")
    now = datetime.now(UTC)
    append(tmp_path, ended("1", now - timedelta(hours=30)))
    assert check_last(tmp_path, day) == (False, "the last night ended 30.0 h ago, expected one within 24.0 h")
    assert check_last(tmp_path, timedelta(hours=31)) == (True, "the last night ended 30.0 h ago, with status 0")
    append(tmp_path, begun("2", now - timedelta(hours=6)))
    said = "the last night ended 30.0 h ago, expected one within 24.0 h; one began 6.0 h ago and did not end"
    assert check_last(tmp_path, day) == (False, said)


def test_ages() -> None:
    assert [age_of(text) / timedelta(minutes=1) for text in ("90m", "26h", "1.5d")] == [90, 1560, 2160]
    for wrong in ("", "26", "h", "-1h", "1w", "1e9h"):
        with pytest.raises(RefusedInput, match="expected an age such as 26h"):
            age_of(wrong)

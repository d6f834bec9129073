"""Every way out of a program that drives heads is dark; each row of the documentation's table names its test."""

import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from waiting import LONG_SECONDS, fault_of, wait_until

from footscan.capture.board.heads import Heads
from footscan.capture.grbl.settings import required_settings
from footscan.virtual.board.board import Board
from schemas.base.errors import Fault
from schemas.rig import RigBoard

pytestmark = pytest.mark.real_time  # a process is to stop the board within a moment of a signal

ROOT = Path(__file__).parents[4]
WITHIN_SECONDS = 0.3
SETTINGS = RigBoard(
    max_mm_per_s=(400.0,) * 3, mm_per_s2=(4000.0,) * 3, homing_mm_per_s=400.0, homing_slow_mm_per_s=100.0
)
BEGIN = """
import hashlib, signal, sys, threading, time
from footscan.capture.grbl.settings import required_settings
from schemas.rig import RigBoard
from footscan.capture.board.heads import Heads
from footscan.capture.board.termination import signals_end_the_program

quick = RigBoard(
    max_mm_per_s=(400.0,) * 3, mm_per_s2=(4000.0,) * 3, homing_mm_per_s=400.0, homing_slow_mm_per_s=100.0
)

def travel(heads):
    heads.home()
    heads.lasers(0.5)
    heads.travel(0.0, 380.0, 60.0)

def travelling(heads):
    thread = threading.Thread(target=travel, args=(heads,), daemon=True)
    thread.start()
    return thread
"""
PROGRAMS = {
    "travels itself": "with signals_end_the_program(), Heads(sys.argv[1], quick) as heads: travel(heads)",
    "waits for a thread": """
with signals_end_the_program(), Heads(sys.argv[1], quick) as heads:
    travelling(heads).join()
""",
    "waits for a lock": """
lock = threading.Lock()
lock.acquire()
with signals_end_the_program(), Heads(sys.argv[1], quick) as heads:
    travelling(heads)
    lock.acquire()
""",
    "is deep in a library": """
with signals_end_the_program(), Heads(sys.argv[1], quick) as heads:
    travelling(heads)
    hashlib.pbkdf2_hmac("sha256", b"a", b"b", 12_000_000)
""",
    "goes on in spite of all": """
with signals_end_the_program(), Heads(sys.argv[1], quick) as heads:
    while True:
        try:
            heads.board.send("$X")
            travel(heads)
        except BaseException:
            if time.monotonic() > float(sys.argv[2]):
                raise
            time.sleep(0.02)
""",
    "just ends": """
heads = Heads(sys.argv[1], quick)
travelling(heads)
time.sleep(float(sys.argv[3]))
""",
}


@pytest.fixture
def board() -> Iterator[Board]:
    with Board(settings={**required_settings(SETTINGS), 26: 5}, heads_at=(-12.0, -8.0, -20.0)) as one:
        yield one


def begun(board: Board, program: str, seconds: float = 0.0) -> "subprocess.Popen[str]":
    """Another program, in the middle of a travel with light."""
    code = BEGIN + PROGRAMS[program]
    line = [sys.executable, "-c", code, board.port, str(time.monotonic() + 10.0), str(seconds)]
    process = subprocess.Popen(line, stderr=subprocess.PIPE, text=True)
    wait_until(lambda: board.laser_at(time.monotonic()) > 0.4)
    time.sleep(0.2)
    return process


def assert_dark_and_standing(board: Board, since: float) -> None:
    times = np.linspace(since, time.monotonic(), 400)
    assert max(board.laser_at(at) for at in times) == 0.0
    assert np.ptp([board.position_at(at) for at in times], axis=0).max() == 0.0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("program", [name for name in PROGRAMS if name != "just ends"])
def test_a_signal_stops_heads_whatever_the_program_does(board: Board, program: str, number: signal.Signals) -> None:
    process = begun(board, program)
    signalled = time.monotonic()
    process.send_signal(number)
    said = process.communicate(timeout=LONG_SECONDS)[1]
    time.sleep(0.3)
    assert process.returncode == 128 + number, said
    assert_dark_and_standing(board, signalled + WITHIN_SECONDS)


def test_a_program_that_just_ends_leaves_heads_dark_and_standing(board: Board) -> None:
    process = begun(board, "just ends", seconds=2.5)
    process.communicate(timeout=LONG_SECONDS)
    assert board.position_at(time.monotonic())[0] < 370.0
    time.sleep(0.5)
    assert_dark_and_standing(board, time.monotonic() - 0.5)


def test_a_stop_passes_a_write_that_hangs(board: Board) -> None:
    with Heads(board.port, SETTINGS) as heads:
        heads.home()
        heads.lasers(0.5)
        travel = threading.Thread(target=lambda: fault_of(lambda: heads.travel(0.0, 300.0, 60.0)))
        travel.start()
        wait_until(lambda: board.laser_at(time.monotonic()) > 0.4)
        line, conversation = heads.board._board._line, heads.board._board
        with line._writing:
            told = time.monotonic()
            stopped: list[bool] = []
            stop = threading.Thread(target=lambda: stopped.append(heads.board._last_stop(for_good=True)))
            stop.start()
            stop.join(LONG_SECONDS)
            time.sleep(0.5)
            assert_dark_and_standing(board, told + WITHIN_SECONDS)
        travel.join(LONG_SECONDS)
        assert stopped == [True]
        assert fault_of(lambda: conversation.send("G0X-3", 1.0)) == "the program was told to end"


def test_a_stop_holds_where_its_bytes_are_lost(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    with Heads(board.port, SETTINGS) as heads:
        heads.home()
        heads.board.jog((0.0, -100.0, 0.0), 20.0)
        wait_until(lambda: board.motion.speed > 0.0)
        write = heads.board._board._line.write_past_all
        lost = [b"!", b"\x18"]

        def loses(data: bytes) -> bool:
            if data in lost:
                lost.remove(data)
                return True
            return write(data)

        monkeypatch.setattr(heads.board._board._line, "write_past_all", loses)
        assert heads.board._last_stop(for_good=True)
        assert lost == []
        assert board.motion.speed == 0.0


def test_a_travel_that_does_not_arrive_fails_and_heads_stop(board: Board, monkeypatch: pytest.MonkeyPatch) -> None:
    with Heads(board.port, SETTINGS) as heads:
        heads.home()
        stream, stop, stops = heads.board.stream, heads.board.stop, []

        def other_way(lines: list[str], *, limit_seconds: float) -> None:
            stream([line.replace("X-120.000", "X-110.000") for line in lines], limit_seconds=limit_seconds)

        def noted() -> None:
            stop()
            stops.append(heads.state.name)

        monkeypatch.setattr(heads.board, "stream", other_way)
        monkeypatch.setattr(heads.board, "stop", noted)
        with pytest.raises(Fault, match="the heads did not go where they were sent"):
            heads.travel_to(100.0)
        assert stops == ["ready"]
        assert_dark_and_standing(board, time.monotonic())


@pytest.mark.parametrize("sent", [0.3, 0.8])
def test_a_travel_of_another_brightness_fails(board: Board, sent: float, monkeypatch: pytest.MonkeyPatch) -> None:
    with Heads(board.port, SETTINGS) as heads:
        heads.home()
        heads.lasers(0.5)
        stream = heads.board.stream

        def brighter(lines: list[str], *, limit_seconds: float) -> None:
            stream([line.replace("S500", f"S{1000 * sent:.0f}") for line in lines], limit_seconds=limit_seconds)

        monkeypatch.setattr(heads.board, "stream", brighter)
        with pytest.raises(Fault, match="the lasers were not as bright as they should be"):
            heads.travel(0.0, 200.0, 100.0)
        assert_dark_and_standing(board, time.monotonic())


def test_an_alarm_ends_the_light(board: Board) -> None:
    with Heads(board.port, SETTINGS) as heads:
        heads.home()
        heads.lasers(0.5)
        travel = threading.Thread(target=lambda: fault_of(lambda: heads.travel(0.0, 300.0, 60.0)))
        travel.start()
        wait_until(lambda: board.laser_at(time.monotonic()) > 0.4)
        board.lose_steps(2, board.position_at(time.monotonic())[1] + 20.5)
        wait_until(lambda: heads.state.name == "alarm")
        assert_dark_and_standing(board, time.monotonic())
        travel.join(LONG_SECONDS)


def test_an_answer_too_many_ends_light_and_motion_at_once(board: Board) -> None:
    with Heads(board.port, SETTINGS) as heads:
        heads.home()
        heads.lasers(0.5)
        travel = threading.Thread(target=lambda: fault_of(lambda: heads.travel(0.0, 300.0, 60.0)))
        travel.start()
        wait_until(lambda: board.laser_at(time.monotonic()) > 0.4)
        for _ in range(8):
            board.line.write("ok", time.monotonic())
        told = time.monotonic()
        travel.join(LONG_SECONDS)
        time.sleep(0.5)
        assert_dark_and_standing(board, told + WITHIN_SECONDS)


def test_each_way_out_names_its_test() -> None:
    text = (ROOT / "docs/scanner_controller.md").read_text(encoding="utf-8")
    table = text.split("## Every way out is dark")[1].split("\n\n")[1]
    rows = [row.strip("| ").split(" | ") for row in table.splitlines()[2:]]
    assert len(rows) >= 13
    for happens, *_, named in rows:
        tests = re.findall(r"`(test_\w+)`", named)
        assert tests or named == "none can be", happens
        for test in tests:
            files = [path for path in ROOT.glob("tests/**/test_*.py") if f"def {test}(" in path.read_text("utf-8")]
            assert len(files) == 1, f"{happens}: {test} is in {files}"

"""The real command, told to end while it moves heads or lights: dark and standing within 0.3 s of the signal."""

import os
import pty
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg
from waiting import LONG_SECONDS, wait_until

from footscan.virtual.board import Board
from footscan.virtual.streams import VirtualStreams, free_running

pytestmark = pytest.mark.real_time

FOOTSCAN = str(Path(sys.executable).with_name("footscan"))
WITHIN_SECONDS = 0.3
GREY = bytes(simplejpeg.encode_jpeg(np.full((480, 640, 3), 20, np.uint8), 90, "RGB", "420"))
RIG = """\
format: footscan.rig/1
scanner: S1
port: {port}
cameras:
  - {{id: 1, device: "{camera}", latency: {{seconds: 0.04, sd_s: 0.001, frame_sd_s: 0.002}}}}
frames_per_second: 20
"""
LIGHT = ("--power", "1", "--exposure-ms", "10")
COMMANDS: dict[str, tuple[str, ...]] = {
    "home": ("home",),
    "jog": ("jog", "all", "380", "--speed", "90"),
    "scan": ("scan", "P1", "right", "--no-measure", *LIGHT),
    "latency": ("calibrate", "latency", *LIGHT),
    "console": ("console", "--port", "0"),
}
ENDS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129, signal.SIGQUIT: 131}


class Scanner:
    """A board and one camera, and commands that use them."""

    def __init__(self, board: Board, folder: Path) -> None:
        self.board, self.folder = board, folder
        self.running: list[subprocess.Popen[str]] = []

    def start(self, name: str, **options: Any) -> "subprocess.Popen[str]":
        """A command in a process of its own, as a shell in a terminal starts it."""
        pipe = subprocess.PIPE
        line = ["/usr/bin/env", "--default-signal=HUP,INT,QUIT", FOOTSCAN, *COMMANDS[name]]
        options = {"stdout": pipe, "stderr": pipe, "stdin": subprocess.DEVNULL} | options
        self.running.append(subprocess.Popen(line, cwd=self.folder, text=True, **options))
        return self.running[-1]

    def started(self, name: str) -> "subprocess.Popen[str]":
        """A command in the midst of what it does."""
        process = self.start(name)
        if name == "console":
            address = str(process.stdout.readline()).strip() if process.stdout else ""
            order(address, "connect", when_idle=True)
            order(address, "scan", b'{"patient": "P1", "side": "right"}', when_idle=True)
        self.wait_until_busy(name, process)
        return process

    def wait_until_busy(self, name: str, process: "subprocess.Popen[str]") -> None:
        """Waits until heads move: lit, in the midst of a jog, or on their way to the switches."""
        is_so: dict[str, Callable[[], object]] = {
            "home": lambda: self.board.position_at(self.board.clock())[0] < 150.0,
            "jog": lambda: self.board.position_at(self.board.clock())[0] > 60.0,
        }
        busy = is_so.get(name, lambda: self.board.laser_at(self.board.clock()) > 0.9)

        def holds() -> object:
            assert process.poll() is None, process.communicate()
            return busy()

        wait_until(holds)
        time.sleep(0.15)

    def assert_dark_and_standing(self, since: float) -> None:
        """From `since` until now, `time.monotonic()` s."""
        times = np.linspace(since, time.monotonic(), 400)
        assert max(self.board.laser_at(at) for at in times) == 0.0
        x = np.array([self.board.position_at(at) for at in times])
        assert np.ptp(x, axis=0).max() == 0.0


def order(address: str, name: str, body: bytes = b"{}", *, when_idle: bool = False) -> None:
    """Tells a console something, as its page does."""
    headers = {"Origin": address.rstrip("/"), "X-Footscan-Page": "a" * 16, "Content-Type": "application/json"}
    end = time.monotonic() + LONG_SECONDS
    while True:
        request = urllib.request.Request(f"{address}do/{name}", body, headers)
        try:
            with urllib.request.urlopen(request, timeout=LONG_SECONDS):
                return
        except urllib.error.HTTPError as error:
            with error:
                assert when_idle and error.code == 409 and time.monotonic() < end, error.read()
        time.sleep(0.1)


@pytest.fixture
def scanner(tmp_path: Path) -> Iterator[Scanner]:
    yield from scanners(tmp_path, (-30.0, -30.0, -30.0))


@pytest.fixture
def far(tmp_path: Path) -> Iterator[Scanner]:
    yield from scanners(tmp_path, (-250.0, -250.0, -250.0))


def scanners(folder: Path, heads_at: tuple[float, float, float]) -> Iterator[Scanner]:
    with (
        Board(heads_at=heads_at) as board,
        VirtualStreams((1,), lambda *_: GREY, free_running(20.0), latency_s=0.04) as streams,
    ):
        (folder / "rig.yaml").write_text(RIG.format(port=board.port, camera=streams.url(1)))
        one = Scanner(board, folder)
        yield one
        for process in one.running:
            process.kill()
            process.communicate()


@pytest.mark.parametrize("number", ENDS, ids=lambda number: number.name)
@pytest.mark.parametrize("name", COMMANDS)
def test_heads_and_lasers_stop_within_a_moment(name: str, number: int, request: pytest.FixtureRequest) -> None:
    scanner: Scanner = request.getfixturevalue("far" if name == "home" else "scanner")
    process = scanner.started(name)
    signalled = time.monotonic()
    process.send_signal(number)
    time.sleep(WITHIN_SECONDS)
    said = process.communicate(timeout=LONG_SECONDS)[1]
    time.sleep(0.5)
    scanner.assert_dark_and_standing(signalled + WITHIN_SECONDS)
    last = said.splitlines()[-1]
    if name == "console" and number in {signal.SIGINT, signal.SIGTERM}:
        assert (process.returncode, last) == (0, "the lasers are off, the console has ended")
    else:
        assert process.returncode == ENDS[signal.Signals(number)]
        assert last.startswith(f"footscan: ended by {signal.Signals(number).name}: heads and lasers are stopped")
    assert "Traceback" not in said


@pytest.mark.parametrize("name", ["jog", "scan", "console"])
def test_a_signal_that_comes_again_changes_nothing(scanner: Scanner, name: str) -> None:
    process = scanner.started(name)
    signalled = time.monotonic()
    for number in (signal.SIGTERM, signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        process.send_signal(number)
        time.sleep(0.03)
    said = process.communicate(timeout=LONG_SECONDS)[1]
    time.sleep(0.5)
    scanner.assert_dark_and_standing(signalled + WITHIN_SECONDS)
    assert process.returncode == (0 if name == "console" else 143)
    assert "Traceback" not in said


@pytest.mark.parametrize("name", ["jog", "scan", "console"])
def test_heads_stop_when_the_terminal_goes_away(scanner: Scanner, name: str) -> None:
    """The command is the terminal's foreground job: it hears SIGHUP, and whatever it says then fails with EIO."""
    ours, terminal = pty.openpty()
    process = scanner.start(
        name, stdin=terminal, stdout=terminal, stderr=terminal, start_new_session=True, preexec_fn=_own_terminal
    )
    os.close(terminal)
    if name == "console":
        address = ""
        while not (found := re.search(r"http://\S+", address)):
            address += os.read(ours, 4096).decode()
        order(found[0], "connect", when_idle=True)
        order(found[0], "scan", b'{"patient": "P1", "side": "right"}', when_idle=True)
    scanner.wait_until_busy(name, process)
    gone = time.monotonic()
    os.close(ours)
    assert process.wait(LONG_SECONDS) == 129
    time.sleep(0.5)
    scanner.assert_dark_and_standing(gone + WITHIN_SECONDS)


def _own_terminal() -> None:
    """Makes the terminal on standard input that of the session."""
    import fcntl
    import termios

    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


def test_heads_stop_before_the_program_is_suspended(scanner: Scanner) -> None:
    process = scanner.started("jog")
    signalled = time.monotonic()
    process.send_signal(signal.SIGTSTP)
    _, status = os.waitpid(process.pid, os.WUNTRACED)
    assert os.WIFSTOPPED(status)
    time.sleep(1.0)
    scanner.assert_dark_and_standing(signalled + WITHIN_SECONDS)
    process.send_signal(signal.SIGCONT)
    said = process.communicate(timeout=LONG_SECONDS)[1]
    scanner.assert_dark_and_standing(signalled + WITHIN_SECONDS)
    assert process.returncode == 3
    assert "footscan: the heads were stopped at X = " in said


def test_output_that_nobody_reads_leaves_nothing_moving(scanner: Scanner) -> None:
    process = scanner.started("jog")
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    process.stderr.close()
    assert process.wait(LONG_SECONDS) == 3
    time.sleep(0.3)
    scanner.assert_dark_and_standing(time.monotonic() - 0.3)

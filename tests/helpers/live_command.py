"""The real command of the live scanner over a virtual board and one camera, both of which the test can look into."""

import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import quick_rig
import simplejpeg
from waiting import LONG_SECONDS, wait_until

from footscan.virtual.board.board import Board
from footscan.virtual.filming.streams import VirtualStreams, free_running

FOOTSCAN = str(Path(sys.executable).with_name("footscan"))
WITHIN_SECONDS = 0.3
GREY = bytes(simplejpeg.encode_jpeg(np.full((480, 640, 3), 20, np.uint8), 90, "RGB", "420"))
RIG = """\
format: footscan.rig/1
scanner: S1
port: {port}
{board}
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
    "console": ("console", "--port", "0", "--calibration", "calibration.json"),
}


class Scanner:
    """A board and one camera, and commands that use them."""

    def __init__(self, board: Board, folder: Path) -> None:
        self.board, self.folder = board, folder
        self.running: list[subprocess.Popen[str]] = []
        self.address = ""
        """Of the console that was started last."""

    def start(self, name: str, more: tuple[str, ...] = (), **options: Any) -> "subprocess.Popen[str]":
        """A command in a process of its own, with `more` options, as a shell in a terminal starts it."""
        pipe = subprocess.PIPE
        line = ["/usr/bin/env", "--default-signal=HUP,INT,QUIT", FOOTSCAN, *COMMANDS[name], *more]
        options = {"stdout": pipe, "stderr": pipe, "stdin": subprocess.DEVNULL} | options
        self.running.append(subprocess.Popen(line, cwd=self.folder, text=True, **options))
        return self.running[-1]

    def started(self, name: str, more: tuple[str, ...] = ()) -> "subprocess.Popen[str]":
        """A command, with `more` options, in the midst of what it does."""
        process = self.start(name, more)
        if name == "console":
            self.address = str(process.stdout.readline()).strip() if process.stdout else ""
            order(self.address, "connect", when_idle=True)
            order(self.address, "scan", b'{"patient": "P1", "side": "right"}', when_idle=True)
        self.wait_until_busy(name, process)
        return process

    def wait_until_busy(self, name: str, process: "subprocess.Popen[str]") -> None:
        """Waits until heads move: lit, in the midst of a jog, or on their way to the switches."""
        is_so: dict[str, Callable[[], object]] = {
            "home": lambda: self.board.position_at(time.monotonic())[0] < 150.0,
            "jog": lambda: self.board.position_at(time.monotonic())[0] > 60.0,
        }
        busy = is_so.get(name, lambda: self.board.laser_at(time.monotonic()) > 0.9)

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
                refused = error.read()
            busy = when_idle and error.code == 409
        assert busy, refused
        assert time.monotonic() < end, refused
        time.sleep(0.1)


def scanners(folder: Path, heads_at: tuple[float, float, float]) -> Iterator[Scanner]:
    with (
        Board(heads_at=heads_at, settings=quick_rig.SETTINGS) as board,
        VirtualStreams((1,), lambda *_: GREY, free_running(20.0), latency_s=0.04) as streams,
    ):
        (folder / "rig.yaml").write_text(RIG.format(port=board.port, board=quick_rig.YAML, camera=streams.url(1)))
        one = Scanner(board, folder)
        yield one
        for process in one.running:
            process.kill()
            process.communicate()

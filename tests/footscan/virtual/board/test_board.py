"""The virtual board on its terminal: what a program of any make sees there, and the truth behind it."""

import errno
import math
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from waiting import LONG_SECONDS, wait_until

from footscan.virtual.board.board import Board
from footscan.virtual.board.line import Harm
from footscan.virtual.board.motion import LaserPower, Motion, Move
from footscan.virtual.board.rails import Gait, Mount, Rail

pytestmark = pytest.mark.real_time  # the board answers on a terminal of the system

QUICK = {24: 600.0, 25: 6000.0, 26: 5, 110: 6000.0, 111: 6000.0, 112: 6000.0, 120: 5000.0, 121: 5000.0, 122: 5000.0}


class Host:
    """A terminal program."""

    def __init__(self, port: str) -> None:
        self.file = os.open(port, os.O_RDWR | os.O_NOCTTY)
        self.heard = b""

    def write(self, data: bytes) -> None:
        os.write(self.file, data)

    def expect(self, text: bytes, seconds: float = LONG_SECONDS) -> bytes:
        """Everything up to `text`; fails where it does not come."""
        end = time.monotonic() + seconds
        while text not in self.heard:
            left = end - time.monotonic()
            assert left > 0, f"no {text!r} in {self.heard!r}"
            if select.select([self.file], [], [], left)[0]:
                self.heard += os.read(self.file, 4096)
        before, self.heard = self.heard.split(text, 1)
        return before

    def ended(self) -> bool:
        """Whether the terminal is hung up: a kernel says so by an error or by the end of the file."""
        try:
            return os.read(self.file, 100) == b""
        except OSError as error:
            return error.errno == errno.EIO

    def close(self) -> None:
        os.close(self.file)


@pytest.fixture
def board() -> Iterator[Board]:
    with Board(settings=QUICK, heads_at=(-12.0, -8.0, -20.0)) as one:
        yield one


@pytest.fixture
def host(board: Board) -> Iterator[Host]:
    one = Host(board.port)
    one.expect(b"to unlock]\r\n")
    yield one
    one.close()


def test_opening_the_port_restarts_the_board(board: Board, host: Host) -> None:
    host.write(b"$X\n")
    host.expect(b"ok\r\n")
    host.close()
    time.sleep(0.1)
    host.file = os.open(board.port, os.O_RDWR | os.O_NOCTTY)
    assert b"Grbl 1.1h ['$' for help]" in host.expect(b"to unlock]\r\n")


def test_home_travel_and_the_truth_of_it(board: Board, host: Host) -> None:
    host.write(b"$H\n")
    host.expect(b"ok\r\n")
    assert board.position_at(time.monotonic()) == pytest.approx((-18.0, -18.0, -18.0), abs=1e-6)
    began = time.monotonic()
    host.write(b"M4S500\nG1X-22Y-22Z-22F3000\nM5\n")
    for _ in range(3):
        host.expect(b"ok\r\n")
    ended = time.monotonic()
    assert board.position_at(ended) == pytest.approx((2.0, 2.0, 2.0))
    assert board.position_at(began) == pytest.approx((-18.0, -18.0, -18.0), abs=1e-6)
    assert board.laser_at(began) == board.laser_at(ended) == 0.0
    assert board.laser_at((began + ended) / 2.0) == pytest.approx(0.5)


def test_a_pulled_cable_ends_the_hosts_end_and_not_the_motion(board: Board, host: Host) -> None:
    host.write(b"$H\n")
    host.expect(b"ok\r\n")
    host.write(b"M4S500\nG1X-50F1200\n")
    host.expect(b"ok\r\nok\r\n")
    board.pull_cable()
    assert not Path(board.port).exists()
    assert host.ended()
    wait_until(lambda: board.laser_at(time.monotonic()) == 0.0)
    assert board.position_at(time.monotonic())[0] == pytest.approx(30.0)
    board.plug_cable()
    again = Host(board.port)
    again.expect(b"to unlock]\r\n")
    again.close()


@pytest.mark.parametrize(
    ("harm", "expected"),
    [("lose", b"[VR:1.1h."), ("double", b"[VEER:1.1h."), ("garbage", b"[V\xfeER:1.1h.")],
)
def test_bytes_on_their_way_to_the_host(board: Board, host: Host, harm: Harm, expected: bytes) -> None:
    board.disturb("to host", harm, after=2)
    host.write(b"$I\n")
    assert host.expect(b"20190830") == expected


def test_bytes_on_their_way_to_the_board(board: Board, host: Host) -> None:
    board.disturb("to board", "lose", after=1)
    host.write(b"$I\n")
    assert host.expect(b"ok\r\n").startswith(b"[HLP:")


def test_late_bytes(board: Board, host: Host) -> None:
    board.disturb("to board", "delay", seconds=0.3)
    began = time.monotonic()
    host.write(b"\n")
    host.expect(b"ok\r\n")
    assert time.monotonic() - began >= 0.3


def test_a_board_that_hangs_says_nothing(board: Board, host: Host) -> None:
    board.frozen = True
    host.write(b"?\n\x18")
    assert not select.select([host.file], [], [], 0.2)[0]


def test_a_stuck_head_is_counted_on(board: Board, host: Host) -> None:
    host.write(b"$H\n")
    host.expect(b"ok\r\n")
    board.stick(2)
    host.write(b"G1X-22Y-22Z-22F3000\nG4P0.01\n?")
    host.expect(b"ok\r\nok\r\n")
    host.write(b"?")
    assert b"MPos:-22.000,-22.000,-22.000" in host.expect(b">")
    assert board.position_at(time.monotonic()) == pytest.approx((2.0, -18.0, 2.0))


def test_mounts_make_world_coordinates_of_rails() -> None:
    mounts = (Mount(-20.0), Mount(-19.5), Mount(400.0, 1))
    with Board(heads_at=(-10.0, -10.0, -10.0), mounts=mounts) as board:
        assert board.position_at(time.monotonic()) == (-10.0, -9.5, 390.0)


def test_runs_alone() -> None:
    with subprocess.Popen([sys.executable, "-m", "footscan.virtual.board.board"], stdout=subprocess.PIPE) as program:
        try:
            assert program.stdout is not None
            host = Host(program.stdout.readline().decode().strip())
            host.expect(b"Grbl 1.1h")
            program.send_signal(signal.SIGINT)
            assert program.wait(LONG_SECONDS) == 0
            host.close()
        finally:
            program.kill()


def test_a_move_takes_as_long_as_a_trapezoid() -> None:
    motion = straight_move(length=100.0, feed=50.0, acceleration=500.0)
    # 0.1 s and 2.5 mm to gain 50 mm/s, as much to lose it, 95 mm between: 2.1 s.
    motion.advance(10.0)
    assert motion.rail_at(0.1)[0] == pytest.approx(-2.5)
    assert motion.rail_at(1.05)[0] == pytest.approx(-50.0)
    assert motion.rail_at(2.0)[0] == pytest.approx(-97.5)
    assert motion.rail_at(2.099)[0] > -100.0
    assert motion.rail_at(2.101)[0] == pytest.approx(-100.0)


def test_a_short_move_is_a_triangle() -> None:
    motion = straight_move(length=1.0, feed=50.0, acceleration=400.0)
    motion.advance(1.0)
    assert motion.rail_at(0.05)[0] == pytest.approx(-0.5)  # 400 x 0.05^2 / 2, half way at the top speed of 20 mm/s
    assert motion.rail_at(0.1)[0] == pytest.approx(-1.0)


def test_what_is_computed_late_is_the_same() -> None:
    often, once = (straight_move(length=100.0, feed=50.0, acceleration=500.0) for _ in range(2))
    for k in range(300):
        often.advance(k * 0.01)
    once.advance(2.99)
    for k in range(250):
        assert often.rail_at(k * 0.01)[0] == pytest.approx(once.rail_at(k * 0.01)[0], abs=1e-9)
        assert often.light_at(k * 0.01) == pytest.approx(once.light_at(k * 0.01), abs=1e-9)


def test_ripple_and_pauses_leave_the_way_as_long_as_it_is() -> None:
    gait = Gait(ripple=0.05, per_second=2.0)
    gait.pauses.append((0.5, 1.0))
    motion = straight_move(length=100.0, feed=50.0, acceleration=500.0)
    motion.advance(10.0)
    at = [motion.rail_at(gait.motion_seconds(k * 0.001))[0] for k in range(4000)]
    assert at[-1] == pytest.approx(-100.0)
    assert at[501] == at[1499]
    speeds = [-(b - a) / 0.001 for a, b in pairwise(at)]
    steady = [v for k, v in enumerate(speeds) if 150 < k < 450 or 1600 < k < 2900]
    assert max(steady) == pytest.approx(52.5, rel=1e-3)
    assert min(steady) == pytest.approx(47.5, rel=1e-3)


def straight_move(*, length: float, feed: float, acceleration: float) -> Motion:
    """Begun at time 0, with light that follows the speed."""
    motion = Motion([Rail(), Rail(), Rail()], (0.0, 0.0, 0.0), 0.0)
    target = (-length, 0.0, 0.0)
    motion.add(Move(target, (-1.0, 0.0, 0.0), length, feed, math.inf, acceleration, LaserPower(0.5, feed)))
    return motion

"""Heads and lasers on the virtual board: world coordinates, light tied to motion, and every way out of it."""

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from waiting import LONG_SECONDS, fault_of, wait_until

from footscan.capture.board.head import Head
from footscan.capture.board.heads import Heads
from footscan.capture.board.position_log import HeadPosition, PositionLog
from footscan.capture.grbl.settings import required_settings
from footscan.virtual.board.board import Board
from footscan.virtual.board.rails import Gait, Mount
from schemas.base.errors import Fault, RefusedInput
from schemas.rig import RigBoard

pytestmark = pytest.mark.real_time  # the board answers on a terminal of the system

SETTINGS = RigBoard(
    max_mm_per_s=(400.0, 400.0, 400.0),
    mm_per_s2=(4000.0, 4000.0, 4000.0),
    homing_mm_per_s=400.0,
    homing_slow_mm_per_s=100.0,
)
QUICK = {**required_settings(SETTINGS), 26: 5}
NEAR = (-12.0, -8.0, -20.0)


@pytest.fixture
def board() -> Iterator[Board]:
    with Board(settings=QUICK, heads_at=NEAR) as one:
        yield one


@pytest.fixture(scope="module")
def shared() -> Iterator[tuple[Board, Heads]]:
    """For tests that leave everything as it was."""
    with Board(settings=QUICK, heads_at=NEAR) as board, Heads(board.port, SETTINGS) as heads:
        heads.home()
        yield board, heads


def test_homing_aligns_heads_whose_switches_are_not_in_line() -> None:
    offsets = (-20.0, -21.5, -18.25)
    mounts = (Mount(offsets[0]), Mount(offsets[1]), Mount(offsets[2]))
    frames = [Head(offset, axis=axis) for axis, offset in enumerate(offsets)]
    with Board(settings=QUICK, heads_at=NEAR, mounts=mounts) as board, Heads(board.port, SETTINGS, frames) as heads:
        assert heads.reach_mm == (-16.25, 408.5)
        heads.home()
        # -16.25 is what all can reach; the board counts in steps of 1/80 mm
        assert board.position_at(time.monotonic()) == pytest.approx((-16.25,) * 3, abs=0.007)
        assert heads.position_mm() == pytest.approx((-16.25,) * 3, abs=0.007)
        heads.travel_to(100.0)
        assert board.position_at(time.monotonic()) == pytest.approx((100.0,) * 3, abs=0.007)


def test_rails_that_home_at_the_far_end() -> None:
    mounts, frames = (Mount(410.0, 1),) * 3, [Head(410.0, 1, axis) for axis in range(3)]
    with Board(settings=QUICK, heads_at=NEAR, mounts=mounts) as board, Heads(board.port, SETTINGS, frames) as heads:
        heads.home()
        assert heads.position_mm() == pytest.approx((408.0,) * 3)
        heads.travel(300.0, 100.0, 400.0)
        assert board.position_at(time.monotonic()) == pytest.approx((80.0,) * 3, abs=0.007)  # 20 mm to slow down


def test_a_travel_is_even_and_lit_between_its_ends(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    heads.lasers(0.6)
    assert board.laser_at(time.monotonic()) == 0.0
    travel = heads.travel(20.0, 120.0, 100.0)
    times = np.linspace(travel.begin_seconds, travel.end_seconds, 4000)
    x = np.array([board.position_at(seconds)[0] for seconds in times])
    light = np.array([board.laser_at(seconds) for seconds in times])
    speed = np.gradient(x, times)
    within = (x > 20.0) & (x < 120.0)
    assert within.sum() > 1000
    assert speed[within] == pytest.approx(100.0, rel=0.02)
    assert light[within] == pytest.approx(0.6, abs=1e-3)
    assert light[0] == light[-1] == 0.0
    assert board.laser_at(time.monotonic()) == 0.0


def test_the_way_to_the_start_is_dark(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    heads.lasers(1.0)
    heads.travel_to(0.0)
    before = time.monotonic()
    travel = heads.travel(150.0, 160.0, 100.0)
    times = np.linspace(before, travel.begin_seconds, 1000)
    assert max(board.laser_at(seconds) for seconds in times) == 0.0


def test_lasers_of_no_power_are_dark(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    heads.lasers(0.0)
    travel = heads.travel(20.0, 60.0, 100.0)
    assert max(board.laser_at(s) for s in np.linspace(travel.begin_seconds, travel.end_seconds, 500)) == 0.0


def test_shine_lights_heads_that_stand_and_ends(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    at = heads.position_mm()
    lit = heads.shine(0.3, 0.4)
    times = np.linspace(lit.begin_seconds, lit.end_seconds, 1000)
    light = np.array([board.laser_at(seconds) for seconds in times])
    assert light.max() == pytest.approx(0.3)
    assert (light > 0.299).mean() * (times[-1] - times[0]) == pytest.approx(0.4, abs=0.01)
    assert board.laser_at(time.monotonic()) == 0.0
    x = [board.position_at(seconds)[0] for seconds in times]
    assert max(x) - min(x) == pytest.approx(0.2, abs=0.013)
    assert heads.position_mm() == pytest.approx(at, abs=1e-9)


def test_jogs_after_shining_are_dark(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    heads.shine(0.3, 0.05)
    heads.jog(30.0, 100.0)
    wait_until(lambda: heads.state.name == "jogging")
    assert board.laser_at(time.monotonic()) == 0.0
    heads.stop_jog()
    wait_until(lambda: heads.state.name == "ready")


def test_what_is_out_of_reach_is_refused_before_anything_moves(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    before = board.position_at(time.monotonic())
    for start, end, speed, words in (
        (-30.0, 100.0, 36.4, "travel: start: -30 mm is out of reach, expected -18 to 410"),
        (0.0, 500.0, 36.4, "travel: end: 500 mm is out of reach, expected -18 to 410"),
        (0.0, float("nan"), 36.4, "travel: end: nan mm is out of reach, expected -18 to 410"),
        (0.0, 100.0, 0.0, "travel: speed: expected up to 400 mm/s, found 0"),
        (0.0, 100.0, 500.0, "travel: speed: expected up to 400 mm/s, found 500"),
    ):
        with pytest.raises(RefusedInput) as refused:
            heads.travel(start, end, speed)
        assert str(refused.value) == words
    assert board.position_at(time.monotonic()) == before
    assert heads.state.name == "ready"


def test_forty_centimetres_in_eleven_seconds_are_within_reach() -> None:
    low, high = -18.0, 410.0
    assert high - low >= 400.0
    assert min(RigBoard().max_mm_per_s) > 400.0 / 11.0


def test_heads_that_are_not_homed_do_not_travel(board: Board) -> None:
    with (
        Heads(board.port, SETTINGS) as heads,
        pytest.raises(Fault, match="the heads are not homed: where the heads stand"),
    ):
        heads.travel(0.0, 10.0, 36.4)


def test_powers_that_are_none(shared: tuple[Board, Heads]) -> None:
    _, heads = shared
    for power in (-0.1, 1.1, float("nan")):
        with pytest.raises(RefusedInput, match="expected a power from 0 to 1"):
            heads.lasers(power)
    for power, seconds in ((0.0, 1.0), (1.1, 1.0), (0.5, 0.0), (0.5, 9.0)):
        with pytest.raises(RefusedInput, match="expected a power up to 1 and up to 5 s"):
            heads.shine(power, seconds)


def test_jogs_stay_within_reach_and_move_one_head(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    heads.travel_to(-18.0)
    with pytest.raises(RefusedInput, match="jog: head 1: -19 mm is out of reach, expected -18 to 410"):
        heads.jog(-1.0, 20.0)
    heads.jog(5.0, 50.0, head=2)
    wait_until(lambda: heads.board.status().report.state == "Idle")
    assert board.position_at(time.monotonic()) == pytest.approx((-18.0, -13.0, -18.0))
    heads.jog(300.0, 50.0)
    wait_until(lambda: heads.state.name == "jogging")
    heads.stop_jog()
    wait_until(lambda: heads.state.name == "ready")
    assert board.position_at(time.monotonic())[0] < 200.0
    heads.home()


def test_the_log_is_true(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    travel = heads.travel(0.0, 100.0, 100.0)
    seconds, x, sd = heads.log.arrays(travel.begin_seconds, travel.end_seconds)
    assert x.shape == (len(seconds), 3)
    assert len(seconds) >= 5  # twice as many, unless the host is busy
    truth = np.array([board.position_at(s) for s in seconds])
    bound = 100.0 * np.sqrt(3.0) * sd + 0.0126  # as far as it can have gone, and a step
    assert (np.abs(x - truth).max(axis=1) <= bound).all()
    assert (np.diff(seconds) > 0).all()


def test_the_log_is_true_with_a_ripple_and_a_pause() -> None:
    gait = Gait(ripple=0.05, per_second=3.0)
    with Board(settings=QUICK, heads_at=NEAR, gait=gait) as board, Heads(board.port, SETTINGS) as heads:
        heads.home()
        threading.Timer(0.5, board.pause, (1.0,)).start()
        travel = heads.travel(0.0, 100.0, 100.0)
        seconds, x, sd = heads.log.arrays(travel.begin_seconds, travel.end_seconds)
        truth = np.array([board.position_at(s) for s in seconds])
        assert (np.abs(x - truth).max(axis=1) <= 105.0 * np.sqrt(3.0) * sd + 0.0126).all()
        assert travel.end_seconds - travel.begin_seconds > 1.9


def test_an_open_lid_stops_light_and_motion_and_the_travel_goes_on(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    heads.travel_to(0.0)
    heads.lasers(0.5)
    travel = threading.Thread(target=heads.travel, args=(0.0, 200.0, 100.0))
    travel.start()
    wait_until(lambda: board.laser_at(time.monotonic()) > 0.4)
    board.open_door()
    wait_until(lambda: heads.state.words == "the lid or door is open: heads and lasers are stopped")
    assert board.laser_at(time.monotonic()) == 0.0
    at = board.position_at(time.monotonic())
    heads.resume()
    time.sleep(0.1)
    assert board.position_at(time.monotonic()) == at
    board.close_door()
    wait_until(lambda: heads.state.words == "the lid or door was open and is closed again")
    heads.resume()
    travel.join(LONG_SECONDS)
    assert board.position_at(time.monotonic())[0] == pytest.approx(201.25, abs=0.007)
    assert board.laser_at(time.monotonic()) == 0.0


def test_lost_steps_are_found_by_feeling_for_the_switches(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    heads.travel(0.0, 50.0, 200.0)
    assert heads.lost_steps_mm() == pytest.approx((0.0, 0.0, 0.0), abs=0.05)
    assert board.memory[20] == board.memory[21] == 1
    board.lose_steps(2, -0.8)
    with pytest.raises(Fault, match=r"heads are not where their steps say: head 2 by -0\.\d+ mm; see what holds them"):
        heads.lost_steps_mm()
    assert heads.state.name == "not homed"
    assert board.memory[20] == board.memory[21] == 1
    heads.home()
    assert heads.lost_steps_mm() == pytest.approx((0.0, 0.0, 0.0), abs=0.05)


def test_limits_are_on_again_however_feeling_for_the_switches_ends(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    held = threading.Thread(target=lambda: fault_of(heads.lost_steps_mm))
    held.start()
    wait_until(lambda: board.memory[21] == 0)
    heads.stop()
    held.join(LONG_SECONDS)
    assert heads.state.name == "not homed"
    heads.home()
    assert board.memory[20] == board.memory[21] == 1


def test_limits_that_were_left_off_are_switched_on_by_the_next_connection() -> None:
    settings = {**QUICK, 20: 0, 21: 0}
    with Board(settings=settings, heads_at=NEAR) as board, Heads(board.port, SETTINGS) as heads:
        assert board.memory[20] == board.memory[21] == 1
        heads.home()


def test_a_head_that_stood_still_is_found_after_the_travel(shared: tuple[Board, Heads]) -> None:
    board, heads = shared
    heads.travel_to(20.0)
    board.stick(3)
    heads.travel(20.0, 50.0, 200.0)
    assert heads.position_mm()[2] == pytest.approx(55.0), "the firmware cannot know"
    assert board.position_at(time.monotonic())[2] == pytest.approx(20.0)
    board.stick(3, False)
    with pytest.raises(Fault):
        heads.lost_steps_mm()
    assert not heads.board.homed
    heads.home()


def test_leaving_by_an_exception_ends_light_and_motion(board: Board) -> None:
    class BrokenError(Exception):
        """Of the program around."""

    def broken_scan() -> None:
        with Heads(board.port, SETTINGS) as heads:
            heads.home()
            heads.lasers(0.5)
            threading.Thread(target=lambda: fault_of(lambda: heads.travel(0.0, 300.0, 100.0))).start()
            wait_until(lambda: board.laser_at(time.monotonic()) > 0.4)
            raise BrokenError

    with pytest.raises(BrokenError):
        broken_scan()
    assert board.laser_at(time.monotonic()) == 0.0
    assert board.motion.speed == 0.0


def test_a_pulled_cable_leaves_light_for_the_motion_under_way_alone(board: Board) -> None:
    heads = Heads(board.port, SETTINGS)
    heads.home()
    heads.lasers(0.5)
    failed: list[str] = []
    travel = threading.Thread(target=lambda: failed.append(fault_of(lambda: heads.travel(0.0, 100.0, 100.0))))
    travel.start()
    wait_until(lambda: board.laser_at(time.monotonic()) > 0.4)
    board.pull_cable()
    travel.join(LONG_SECONDS)
    assert "the connection to the board is lost" in failed[0]
    assert heads.state.name == "lost"
    wait_until(lambda: board.laser_at(time.monotonic()) == 0.0)
    assert board.position_at(time.monotonic())[0] == pytest.approx(101.25, abs=0.007), "it went to its end, and dark"
    heads.close()


PROGRAM = """
import sys
from footscan.capture.grbl.settings import required_settings
from schemas.rig import RigBoard
from footscan.capture.board.heads import Heads
from footscan.capture.board.termination import signals_end_the_program

quick = RigBoard(max_mm_per_s=(400.0,) * 3, mm_per_s2=(4000.0,) * 3, homing_mm_per_s=400.0, homing_slow_mm_per_s=100.0)
with signals_end_the_program(), Heads(sys.argv[1], quick) as heads:
    heads.home()
    heads.lasers(0.5)
    print("ready", flush=True)
    heads.travel(0.0, 300.0, 200.0)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_program_that_is_told_to_end_ends_light_and_motion(board: Board, number: signal.Signals) -> None:
    program = begun_program(board)
    program.send_signal(number)
    assert program.wait(LONG_SECONDS) != 0
    assert board.laser_at(time.monotonic()) == 0.0
    assert board.motion.speed == 0.0
    assert board.position_at(time.monotonic())[0] < 290.0


def test_a_program_that_is_killed_leaves_light_for_the_motion_under_way_alone(board: Board) -> None:
    program = begun_program(board)
    program.kill()
    program.wait(LONG_SECONDS)
    wait_until(lambda: board.laser_at(time.monotonic()) == 0.0)
    wait_until(lambda: board.motion.speed == 0.0)
    assert board.laser_at(time.monotonic()) == 0.0


def begun_program(board: Board) -> "subprocess.Popen[bytes]":
    """Another program, in the middle of a travel."""
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, board.port], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert program.stdout is not None
    with program.stdout:
        assert program.stdout.readline() == b"ready\n"
    wait_until(lambda: board.laser_at(time.monotonic()) > 0.4)
    return program


def test_a_position_log_may_be_read_in_parts() -> None:
    log = PositionLog()
    for k in range(5):
        log.add(HeadPosition(float(k), (k * 1.0, k * 2.0, k * 3.0), 0.003, True))
    assert [entry.seconds for entry in log.between(1.0, 3.0)] == [1.0, 2.0, 3.0]
    seconds, x, sd = log.arrays(3.5)
    assert seconds.tolist() == [4.0]
    assert x.tolist() == [[4.0, 8.0, 12.0]]
    assert sd == pytest.approx(0.003 / 3**0.5)
    assert len(log.arrays(9.0)[1]) == 0
    assert len(log) == len(list(log)) == 5

"""The clock of a world waits for what holds it, in all processes that follow it."""

import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from footscan import clock
from footscan.clock import LONGEST_HOLD_SECONDS, WorldClock, _State


def test_without_a_world_it_is_the_systems_clock() -> None:
    before = time.monotonic()
    assert before <= clock.seconds() <= time.monotonic()
    clock.hold("picture", before)  # nothing holds it
    assert clock.seconds() >= before
    assert not clock.is_of_a_world()


def test_it_stands_at_the_earliest_hold_and_goes_on_from_there(tmp_path: Path) -> None:
    world = WorldClock(tmp_path / "clock")
    now = world.seconds()
    world.hold("late", now + 60.0)
    world.hold("early", now + 0.01)
    time.sleep(0.05)
    assert world.seconds() == now + 0.01
    world.release("early")
    again = world.seconds()
    assert now + 0.01 <= again < now + 0.04  # what it stood is not made up for
    time.sleep(0.02)
    assert world.seconds() >= again + 0.02


def test_a_hold_in_the_past_stops_it_and_never_sets_it_back(tmp_path: Path) -> None:
    world = WorldClock(tmp_path / "clock")
    now = world.seconds()
    world.hold("picture", now - 1.0)
    stands_at = world.seconds()
    assert stands_at >= now
    time.sleep(0.02)
    assert world.seconds() == stands_at


def test_a_clock_that_nobody_releases_goes_on() -> None:
    state = _State(system=100.0, world=50.0, held_at=51.0)
    assert state.seconds(100.5) == 50.5
    assert state.seconds(102.0) == state.seconds(101.0 + LONGEST_HOLD_SECONDS) == 51.0
    assert state.seconds(103.0 + LONGEST_HOLD_SECONDS) == 53.0


def test_another_process_reads_the_same(tmp_path: Path) -> None:
    file = tmp_path / "clock"
    world = WorldClock(file)
    read = (
        "import sys; from pathlib import Path; from footscan import clock\n"
        "with clock.following(Path(sys.argv[1])): print(clock.seconds(), clock.is_of_a_world())"
    )
    world.hold("picture", world.seconds())
    stands_at = world.seconds()
    shown = subprocess.run([sys.executable, "-c", read, file], check=True, capture_output=True, text=True).stdout
    assert shown.split() == [repr(stands_at), "True"]


@pytest.mark.parametrize("is_set", [False, True])
def test_waiting_goes_by_the_clock(tmp_path: Path, is_set: bool) -> None:
    world = WorldClock(tmp_path / "clock")
    event, condition = threading.Event(), threading.Condition()
    with clock.keeping(world):
        now = clock.seconds()
        clock.hold("picture", now + 0.01)
        released = threading.Timer(0.1, event.set if is_set else lambda: clock.release("picture"))
        begin = time.monotonic()
        released.start()
        assert clock.wait_until(event, now + 0.02) == is_set
        assert time.monotonic() - begin >= 0.1
        clock.release("picture")
        with condition:
            assert clock.wait_for(condition, lambda: True, 1.0)
            assert not clock.wait_for(condition, lambda: False, 0.01)

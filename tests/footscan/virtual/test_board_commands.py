"""The virtual board's start-up and `$` commands, as the documentation of Grbl 1.1 tells them."""

import pytest
from board_bench import LOCKED, WELCOME, Bench

from footscan.virtual.board.gcode import Modes
from footscan.virtual.board.memory import FACTORY

# --- Start-up message


def test_welcome_and_lock_after_power_up_where_homing_is_on(bench: Bench) -> None:
    assert bench.at_power_up == [*WELCOME, LOCKED]
    assert bench.state == "Alarm"


def test_welcome_alone_where_homing_is_off() -> None:
    bench = Bench({20: 0, 22: 0})
    assert bench.at_power_up == WELCOME
    assert bench.state == "Idle"


def test_check_limits_where_a_switch_is_pressed() -> None:
    assert Bench(heads_at=(0.5, -8.0, -20.0)).at_power_up == [*WELCOME, "[MSG:Check Limits]", LOCKED]


def test_door_open_at_start() -> None:
    bench = Bench({20: 0, 22: 0})
    bench.firmware.pins.door_open = True
    assert bench.send("\x18") == [*WELCOME, "[MSG:Check Door]"]
    assert bench.state == "Door:1"


# --- '$' commands


def test_help(bench: Bench) -> None:
    assert bench.send("$\n") == ["[HLP:$$ $I $x=val $J=line $X $H ~ ! ? ctrl-x]", "ok"]


def test_view_settings(bench: Bench) -> None:
    bench.memory.settings = dict(FACTORY)
    lines = bench.send("$$\n")
    assert lines[:3] == ["$0=10", "$1=25", "$2=0"]
    assert "$11=0.010" in lines
    assert "$100=250.000" in lines
    assert lines[-2:] == ["$132=200.000", "ok"]
    assert len(lines) == 35


def test_write_a_setting(bench: Bench) -> None:
    assert bench.send("$110=2500.5\n") == ["ok"]
    assert "$110=2500.500" in bench.send("$$\n")


def test_homing_off_takes_soft_limits_along(bench: Bench) -> None:
    bench.send("$22=0\n")
    assert "$20=0" in bench.send("$$\n")


def test_build(bench: Bench) -> None:
    assert bench.send("$I\n") == ["[VER:1.1h.20190830:]", "[OPT:V+,15,128]", "ok"]


def test_kill_alarm_lock(bench: Bench) -> None:
    assert bench.send("$X\n") == ["[MSG:Caution: Unlocked]", "ok"]
    assert bench.state == "Idle"
    assert bench.send("$X\n") == ["ok"]


def test_homing_finds_all_switches_and_pulls_off(bench: Bench) -> None:
    assert bench.send("$H\n", 6.0) == ["ok"]
    assert bench.state == "Idle"
    assert bench.motion.steps == (-2.0, -2.0, -2.0)
    assert bench.motion.rail_at(bench.now) == pytest.approx((-2.0, -2.0, -2.0), abs=1e-6)


def test_homing_toward_the_far_end(bench: Bench) -> None:
    bench.send("$23=2\n")  # the Y axis searches in negative direction
    assert bench.send("$H\n", 10.0) == ["ok"]
    assert bench.motion.steps == (-2.0, -428.0, -2.0)
    assert bench.motion.rail_at(bench.now)[1] == pytest.approx(-438.0)


def test_one_status_report_for_all_queries_while_homing(bench: Bench) -> None:
    assert bench.send("$H\n", 0.1) == []
    assert bench.send("?", 0.1) == []
    assert bench.send("?", 0.1) == []
    assert bench.firmware.state == "Home"
    bench.wait(6.0)
    report, ok = bench.take()
    assert report.startswith("<Home|MPos:-2.000,-2.000,-2.000")
    assert ok == "ok"


def test_jog_is_a_state_of_its_own_and_leaves_the_modes(homed: Bench) -> None:
    assert homed.send("$J=G91 X-10 F600\n") == ["ok"]
    assert homed.state == "Jog"
    assert homed.send("G1 X-3 F100\n") == ["error:9"]
    homed.wait(1.1)
    assert homed.motion.steps[0] == pytest.approx(-12.0)
    assert homed.firmware.modes == Modes()


def test_jog_in_machine_coordinates(homed: Bench) -> None:
    assert homed.send("$J=G91 G53 X-25 F6000\n", 1.0) == ["ok"]
    assert homed.motion.steps[0] == pytest.approx(-25.0)


def test_jogs_queue_up_and_are_all_cancelled(homed: Bench) -> None:
    homed.send("$J=G91 X-5 F600\n$J=G91 X-5 F600\n", 0.3)
    assert homed.send("\x85", 0.1) == []
    assert homed.state == "Idle"
    at = homed.motion.steps[0]
    assert -7.0 < at < -4.0
    homed.send("$J=G91 X-1 F600\n", 0.3)
    assert homed.motion.steps[0] == pytest.approx(at - 1.0)  # what comes next begins where it stopped


def test_feed_hold_cancels_a_jog(homed: Bench) -> None:
    homed.send("$J=G91 X-50 F600\n", 0.3)
    homed.send("!", 0.1)
    assert homed.state == "Idle"

"""The virtual board's start-up and `$` commands, as the documentation of Grbl 1.1 tells them."""

import pytest
from board_bench import LOCKED, WELCOME, Bench

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
    assert bench.send("$\n") == ["[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]", "ok"]


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


def test_parameters(homed: Bench) -> None:
    assert homed.send("G10 L2 P2 X1 Y2 Z3\nG92 Z0.5\nG43.1 Z1.25\n") == ["ok"] * 3
    lines = homed.send("$#\n")
    assert lines[0] == "[G54:0.000,0.000,0.000]"
    assert lines[1] == "[G55:1.000,2.000,3.000]"
    assert lines[6:8] == ["[G28:0.000,0.000,0.000]", "[G30:0.000,0.000,0.000]"]
    assert lines[8:] == ["[G92:0.000,0.000,-2.500]", "[TLO:1.250]", "[PRB:0.000,0.000,0.000:0]", "ok"]


def test_modes(homed: Bench) -> None:
    assert homed.send("$G\n") == ["[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]", "ok"]
    homed.send("G1 G55 G18 G20 G91 M4 M8 T7 F10 S500\n")
    assert homed.send("$G\n") == ["[GC:G1 G55 G18 G20 G91 G94 M4 M8 T7 F254 S500]", "ok"]


def test_build(bench: Bench) -> None:
    assert bench.send("$I\n") == ["[VER:1.1h.20190830:]", "[OPT:V+,15,128]", "ok"]
    assert bench.send("$I=left leg\n") == ["ok"]
    assert bench.send("$I\n")[0] == "[VER:1.1h.20190830:LEFTLEG]"


def test_start_up_lines(homed: Bench) -> None:
    assert homed.send("$N0=G20 G54\n") == ["ok"]
    assert homed.send("$N\n") == ["$N0=G20G54", "$N1=", "ok"]
    assert homed.send("\x18") == [*WELCOME, ">G20G54:ok"]
    assert homed.send("$N0=G21\n") == ["ok"]
    assert homed.send("$H\n", 6.0) == ["ok", ">G21:ok"]


def test_start_up_line_that_is_no_longer_valid_or_cannot_be_read(homed: Bench) -> None:
    homed.memory.start_up = ["G99", ""]
    assert homed.send("\x18") == [*WELCOME, ">G99:error:20"]
    homed.memory.damaged.add("start-up")
    assert ">:error:7" in homed.send("\x18")


def test_check_mode_moves_nothing_and_ends_with_a_reset(homed: Bench) -> None:
    assert homed.send("$C\n") == ["[MSG:Enabled]", "ok"]
    before = homed.motion.steps
    assert homed.send("G1 X-50 F1000\nM3 S500\nG4 P9\n") == ["ok"] * 3
    assert homed.motion.steps == before
    assert homed.light == 0.0
    assert homed.state == "Check"
    assert homed.send("$C\n") == ["[MSG:Disabled]", "ok", *WELCOME]


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
    assert homed.send("$G\n")[0].startswith("[GC:G0 G54 G17 G21 G90")


def test_jog_in_inches_and_machine_coordinates(homed: Bench) -> None:
    homed.send("G10 L2 P1 X-1\n")
    assert homed.send("$J=G20 G53 X-1 F100\n", 1.0) == ["ok"]
    assert homed.motion.steps[0] == pytest.approx(-25.4)


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


def test_sleep_ends_with_a_reset_and_a_lock(homed: Bench) -> None:
    assert homed.send("$SLP\n") == ["[MSG:Sleeping]", "ok"]
    assert homed.state == "Sleep"
    assert homed.send("G0 X-3\n") == []
    assert homed.send("\x18") == [*WELCOME, LOCKED]


@pytest.mark.parametrize("what", "$#*")
def test_restore_defaults(homed: Bench, what: str) -> None:
    homed.send("G10 L2 P1 X-5\n$N0=G21\n")
    assert homed.send(f"$RST={what}\n") == ["[MSG:Restoring defaults]", "ok", *WELCOME] + [">G21:ok"] * (what != "*")
    assert (homed.memory[100] == FACTORY[100]) == (what in "$*")
    assert (homed.memory.systems["G54"] == (0.0, 0.0, 0.0)) == (what in "#*")

"""Every alarm of Grbl 1.1 on the virtual board but those of probing, and what it takes to get out of it."""

import pytest
from board_bench import LOCKED, WELCOME, Bench

from footscan.virtual.board.memory import Build

# --- Alarms


def test_alarm_1_hard_limit_stops_dead_and_waits_for_a_reset(homed: Bench) -> None:
    homed.send("$20=0\n")
    assert homed.send("M4 S500\nG1 X5 F1200\n", 0.5) == ["ok", "ok", "ALARM:1", "[MSG:Reset to continue]"]
    assert homed.light == 0.0
    assert homed.motion.speed == 0.0
    assert homed.send("?$X\n") == []
    assert homed.send("\x18") == [*WELCOME, "[MSG:Check Limits]", LOCKED]
    assert "|Pn:X|" in homed.send("?")[0]
    assert homed.motion.rail_at(homed.now)[0] > 0.01, "it slid on, and nobody counted that"


def test_alarm_1_at_the_far_switch_too(homed: Bench) -> None:
    homed.send("$20=0\n")
    assert "ALARM:1" in homed.send("G0 Y-450\n", 3.0)
    assert homed.motion.rail_at(homed.now)[1] < -440.0


def test_alarm_2_soft_limit_keeps_the_position(homed: Bench) -> None:
    assert homed.send("G0 X-431\n") == ["ALARM:2", "[MSG:Reset to continue]"]
    assert homed.send("\x18") == ["ok", *WELCOME, LOCKED]
    assert homed.motion.steps == (-2.0, -2.0, -2.0)


def test_alarm_2_in_motion_stops_slowly_first(homed: Bench) -> None:
    answers = homed.send("G1 X-50 F1200\nG1 X-500\n", 0.5)
    assert answers == ["ok", "ALARM:2", "[MSG:Reset to continue]"]
    assert homed.motion.rail_at(homed.now)[0] == pytest.approx(homed.motion.steps[0], abs=1e-6)


def test_alarm_3_reset_in_motion_loses_the_position(homed: Bench) -> None:
    homed.send("G1 X-50 F6000\n", 0.2)
    assert homed.send("\x18", 0.1) == ["ALARM:3"]
    assert homed.motion.speed == 0.0
    homed.wait(0.5)
    assert homed.take() == [*WELCOME, LOCKED]
    assert abs(homed.motion.rail_at(homed.now)[0] - homed.motion.steps[0]) > 0.1


def test_no_alarm_3_in_a_hold_that_is_complete(homed: Bench) -> None:
    homed.send("G1 X-50 F6000\n", 0.2)
    homed.send("!", 0.2)
    assert homed.send("\x18") == WELCOME
    assert homed.state == "Idle"


def test_alarm_6_reset_while_homing(bench: Bench) -> None:
    bench.send("$H\n", 0.1)
    assert bench.send("\x18", 1.0) == ["ALARM:6", "ok", *WELCOME, LOCKED]


def test_alarm_7_door_while_homing(bench: Bench) -> None:
    bench.send("$H\n", 0.1)
    bench.firmware.pins.door_open = True
    assert bench.send("", 1.0) == ["ALARM:7", "ok", *WELCOME, LOCKED]


def test_alarm_8_switch_stays_pressed(bench: Bench) -> None:
    bench.motion.rails[1].welded_switches = True
    assert bench.send("$H\n", 6.0) == ["ALARM:8", "ok", *WELCOME, "[MSG:Check Limits]", LOCKED]


@pytest.mark.parametrize("mishap", ["stuck", "broken_switches"])
def test_alarm_9_switch_not_found(bench: Bench, mishap: str) -> None:
    setattr(bench.motion.rails[2], mishap, True)
    assert bench.send("$H\n", 10.0) == ["ALARM:9", "ok", *WELCOME, LOCKED]


def test_alarm_10_second_motor_of_an_axis() -> None:
    bench = Bench(build=Build(second_motor=True))
    bench.firmware.second_switch_missing = True
    bench.motion.rails[2].broken_switches = True
    assert bench.send("$H\n", 10.0)[0] == "ALARM:10"


def test_all_alarms_are_dark(homed: Bench) -> None:
    homed.send("G1 F600\nM3 S500\nG1 X-30\n", 0.3)
    assert homed.light == 0.5
    homed.send("\x18", 1.0)
    assert homed.light == 0.0


def test_lost_power_forgets_the_position(homed: Bench) -> None:
    homed.send("G0 X-50\n", 1.0)
    homed.motion.kill()
    homed.firmware.power_up()
    assert homed.take() == [*WELCOME, LOCKED]
    assert homed.motion.steps == (0.0, 0.0, 0.0)
    assert homed.motion.rail_at(homed.now)[0] == pytest.approx(-50.0)
    assert homed.state == "Alarm"

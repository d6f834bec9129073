"""The virtual board's realtime commands and status reports, as the documentation of Grbl 1.1 tells them."""

import pytest
from board_bench import WELCOME, Bench, home

from footscan.virtual.board.memory import Build

# --- Realtime commands


def test_soft_reset_of_heads_that_stand_keeps_the_position(homed: Bench) -> None:
    assert homed.send("\x18") == WELCOME
    assert homed.state == "Idle"
    assert homed.motion.steps == (-2.0, -2.0, -2.0)


def test_realtime_commands_are_picked_out_of_a_line(homed: Bench) -> None:
    [report, answer] = homed.send("G0?X-2\n")
    assert report.startswith("<Idle")
    assert answer == "ok"


def test_two_queries_before_a_report_get_one(homed: Bench) -> None:
    assert len(homed.send("??")) == 1


def test_feed_hold_and_resume(homed: Bench) -> None:
    homed.send("G1 X-50 F1200\n", 0.5)
    homed.firmware.receive(b"!")
    assert homed.firmware.substate == 1
    assert homed.state == "Hold:0"
    at = homed.motion.steps[0]
    homed.wait(1.0)
    assert homed.motion.steps[0] == at
    homed.send("~", 3.0)
    assert homed.state == "Idle"
    assert homed.motion.steps[0] == -50.0


def test_hold_of_heads_that_stand(homed: Bench) -> None:
    homed.send("!")
    assert homed.state == "Hold:0"
    assert homed.send("G0 X-3\n") == []  # lines wait
    assert homed.send("~", 0.2) == ["ok"]


def test_door_stops_motion_and_light_until_it_is_closed_and_resumed(homed: Bench) -> None:
    homed.send("$120=500\nM4 S1000\nG1 X-50 F1200\n", 0.5)
    assert homed.light == pytest.approx(1.0)
    homed.firmware.pins.door_open = True
    homed.wait(0.002)
    assert homed.firmware.substate == 2
    assert homed.send("?", 0.1)[0] == "[MSG:Check Door]"
    assert homed.state == "Door:1"
    assert homed.light == 0.0
    homed.send("~", 0.2)
    assert homed.state == "Door:1"
    homed.firmware.pins.door_open = False
    assert homed.state == "Door:0"
    assert homed.light == 0.0
    homed.send("~", 0.2)
    assert homed.state == "Run"
    assert homed.light == pytest.approx(1.0)
    homed.wait(3.0)
    assert homed.motion.steps[0] == -50.0


def test_door_by_its_character(homed: Bench) -> None:
    assert homed.send("\x84") == ["[MSG:Check Door]"]
    assert homed.state == "Door:0"
    homed.send("~")
    assert homed.state == "Idle"


def test_door_ends_a_jog(homed: Bench) -> None:
    homed.send("$J=G91 X-50 F600\n", 0.2)
    homed.send("\x84", 0.1)
    assert homed.state == "Door:0"
    homed.send("~", 0.1)
    assert homed.state == "Idle"


def test_a_build_without_a_door_input_does_not_see_it() -> None:
    bench = home(Bench(build=Build(door_pin=False)))
    bench.firmware.pins.door_open = True
    assert bench.state == "Idle"
    assert bench.send("$I\n")[1] == "[OPT:V,15,128]"


def overrides(bench: Bench, characters: str) -> tuple[int, ...]:
    """What is in force after realtime characters; the report after the next tells it."""
    bench.send(characters)
    reports = bench.send("?") + bench.send("?")
    [told] = [field[3:] for report in reports for field in report.strip("<>").split("|") if field.startswith("Ov:")]
    return tuple(int(value) for value in told.split(","))


@pytest.mark.parametrize(
    ("characters", "expected"),
    [
        ("\x91", (110, 100, 100)),
        ("\x92", (90, 100, 100)),
        ("\x93", (101, 100, 100)),
        ("\x94", (99, 100, 100)),
        ("\x91" * 20, (200, 100, 100)),
        ("\x92" * 20, (10, 100, 100)),
        ("\x96", (100, 50, 100)),
        ("\x97", (100, 25, 100)),
        ("\x9a", (100, 100, 110)),
        ("\x9b", (100, 100, 90)),
        ("\x9c", (100, 100, 101)),
        ("\x9d", (100, 100, 99)),
        ("\x91\x97\x9a", (110, 25, 110)),
    ],
)
def test_overrides(homed: Bench, characters: str, expected: tuple[int, ...]) -> None:
    homed.send("??")
    homed.send("?")
    assert overrides(homed, characters) == expected
    assert overrides(homed, "\x90\x95\x99") == (100, 100, 100)


def test_feed_override_changes_the_speed_on_the_way(homed: Bench) -> None:
    homed.send("G1 X-100 F600\n", 0.5)
    assert homed.motion.speed == pytest.approx(10.0)
    homed.send("\x91\x91", 0.2)
    assert homed.motion.speed == pytest.approx(12.0)


def test_garbage_beyond_ascii_is_thrown_away(homed: Bench) -> None:
    assert homed.send("\xfe\xffG0\x80 X-2\n") == ["ok"]


# --- Status reports


def test_first_report_tells_the_offset_and_the_second_the_overrides(homed: Bench) -> None:
    homed.send("\x18")
    assert homed.send("?") == ["<Idle|MPos:-2.000,-2.000,-2.000|FS:0,0|WCO:0.000,0.000,0.000>"]
    assert homed.send("?") == ["<Idle|MPos:-2.000,-2.000,-2.000|FS:0,0|Ov:100,100,100>"]
    assert homed.send("?") == ["<Idle|MPos:-2.000,-2.000,-2.000|FS:0,0>"]
    more = [homed.send("?")[0] for _ in range(20)]
    assert sum("WCO" in report for report in more) == 2
    assert sum("Ov:" in report for report in more) == 2
    assert not any("WCO" in report and "Ov:" in report for report in more)


def test_work_positions_and_buffers_by_the_mask(homed: Bench) -> None:
    homed.send("$10=2\n")
    assert homed.send("?")[0].startswith("<Idle|WPos:-2.000,-2.000,-2.000|Bf:15,128|FS:0,0|WCO:0.000,")


def test_reports_in_inches(homed: Bench) -> None:
    homed.send("$13=1\nG0 X-25.4\n", 0.5)
    assert homed.send("?")[0].startswith("<Idle|MPos:-1.0000,")


def test_report_in_motion_tells_speed_power_and_accessories(homed: Bench) -> None:
    for _ in range(3):
        homed.send("?")
    homed.send("M4 S400\nG1 X-60 F1800\n", 0.5)
    [report] = homed.send("?")
    assert "|FS:1800,400|" in report
    assert report.endswith("|Ov:100,100,100|A:C>")


def test_pins(bench: Bench) -> None:
    bench.firmware.pins.door_open = True
    bench.motion.push(1, 100.0)
    assert "|Pn:YD|" in bench.send("?")[0]


def test_positions_are_in_whole_steps(homed: Bench) -> None:
    homed.send("$100=3\nG1 X-10 F600\n", 0.35)
    position = float(homed.send("?")[0].split("MPos:")[1].split(",")[0])
    assert position * 3.0 == pytest.approx(round(position * 3.0), abs=2e-3)
    assert -6.0 < position < -4.0

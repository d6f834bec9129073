"""How the virtual board takes lines, and its laser mode, as the documentation of Grbl 1.1 tells them."""

import pytest
from board_bench import Bench

# --- Streaming


def test_answers_come_in_order_and_moves_wait_in_the_planner(homed: Bench) -> None:
    answers = homed.send("".join(f"G1 X{-3 - k} F600\n" for k in range(8)))
    assert answers == ["ok"] * 8
    homed.wait(2.0)
    assert homed.motion.steps[0] == -10.0


def test_a_full_planner_makes_lines_wait(homed: Bench) -> None:
    answers = homed.send("".join(f"G1X-{k}F60\n" for k in range(3, 14)))
    answers += homed.send("".join(f"G1X-{k}F60\n" for k in range(14, 24)))
    assert len(answers) == 15
    homed.wait(1.1)  # one move is done: there is room for one more
    assert len(homed.take()) == 1


def test_the_receive_buffer_holds_128_bytes_and_loses_the_rest(homed: Bench) -> None:
    homed.send("G4 P0.2\n")
    homed.firmware.receive(b"\n" * 200)
    homed.wait(0.5)
    assert homed.take() == ["ok"] * 129


def test_empty_lines_comments_and_spaces(homed: Bench) -> None:
    assert homed.send("\n(nothing)\n; nothing\ng 1 x -3 (there) f 100\n") == ["ok"] * 4
    assert homed.firmware.modes.motion == "G1"


def test_moves_in_one_direction_pass_into_each_other(homed: Bench) -> None:
    homed.send("G1 X-12 F600\nG1 X-22\n", 1.0)
    assert homed.motion.speed == pytest.approx(10.0)


# --- Laser mode


def test_m4_follows_the_speed_and_is_dark_at_rest(homed: Bench) -> None:
    homed.send("$120=100\nM4 S800\nG1 F1200\n")
    assert homed.light == 0.0
    homed.firmware.receive(b"X-42\n")
    homed.wait(0.102)  # 100 mm/s^2 for a tenth of a second: 10 of 20 mm/s
    assert homed.light == pytest.approx(0.4, rel=0.03)
    homed.wait(0.3)
    assert homed.light == pytest.approx(0.8)
    homed.wait(3.0)
    assert homed.light == 0.0


def test_m3_shines_at_rest_in_g1_only(homed: Bench) -> None:
    homed.send("M3 S500\n")
    assert homed.light == 0.0  # G0 is the mode after a reset
    homed.send("G1 F100\n")
    assert homed.light == 0.5
    homed.send("G0\n")
    assert homed.light == 0.0


def test_g0_is_dark(homed: Bench) -> None:
    homed.send("$110=600\nM3 S500\nG1 F100 X-3\n", 1.0)
    assert homed.light == 0.5
    homed.send("G0 X-20\n", 0.5)
    assert homed.motion.speed > 0.0
    assert homed.light == 0.0


def test_a_new_power_comes_with_its_motion_without_a_stop(homed: Bench) -> None:
    homed.send("M3 S100 G1 F600\nX-12\nX-22 S900\n", 0.5)
    assert homed.light == pytest.approx(0.1)
    homed.wait(1.0)
    assert homed.motion.speed == pytest.approx(10.0)
    assert homed.light == pytest.approx(0.9)


def test_light_ends_with_m5_reset_and_hold(homed: Bench) -> None:
    lit = "G1 F600\nM3 S500\n"
    homed.send(lit)
    assert homed.light == 0.5
    homed.send("M5\n")
    assert homed.light == 0.0
    homed.send(lit)
    homed.send("\x18")
    assert homed.light == 0.0
    homed.send(lit + "G1 X-30\n", 0.3)
    assert homed.light == 0.5
    homed.send("!", 0.2)
    assert homed.light == 0.0
    homed.send("~", 0.2)
    assert homed.light == 0.5


def test_a_board_that_runs_dry_goes_dark_under_m4_and_not_under_m3(homed: Bench) -> None:
    homed.send("M4 S500\nG1 X-20 F1200\n", 3.0)
    assert homed.light == 0.0
    homed.send("M3 S500\nG1 X-2\n", 3.0)
    assert homed.light == 0.5


def test_power_override(homed: Bench) -> None:
    homed.send("G1 F600\nM3 S500\n")
    homed.send("\x9a", 0.1)
    assert homed.light == pytest.approx(0.55)


def test_dwell_waits_for_motion_and_then_for_its_time(homed: Bench) -> None:
    assert homed.send("G1 X-12 F600\nG4 P0.5\n", 1.2) == ["ok"]
    assert homed.send("", 0.5) == ["ok"]

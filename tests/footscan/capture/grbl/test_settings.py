"""What a scanner's board must be set to, and what is said of one that is not."""

import pytest

from footscan.capture.grbl.settings import check_settings, required_settings, setting_line, setup_lines
from schemas.base.errors import RefusedInput
from schemas.rig import RigBoard


def test_a_board_that_is_set_up_is_taken() -> None:
    check_settings({**required_settings(RigBoard()), 11: 0.01, 12: 0.002}, RigBoard(), "board")


def test_speeds_are_per_minute_on_the_board() -> None:
    wanted = required_settings(RigBoard(max_mm_per_s=(50.0, 60.0, 70.0), homing_mm_per_s=40.0))
    assert (wanted[110], wanted[111], wanted[112], wanted[25]) == (3000.0, 3600.0, 4200.0, 2400.0)


@pytest.mark.parametrize(
    ("number", "value", "words"),
    [
        (32, 0, "$32 (laser mode): is 0, expected 1: send $32=1"),
        (22, 0, "$22 (homing): is 0, expected 1: send $22=1"),
        (101, 250.0, "$101 (steps/mm of head 2): is 250, expected 80: send $101=80"),
        (112, 500.0, "$112 (maximum rate of head 3, mm/min): is 500, expected 6000: send $112=6000"),
        (130, 200.0, "$130 (maximum travel of head 1, mm): is 200, expected 430: send $130=430"),
        (27, None, "$27 (homing pull-off, mm): is missing, expected 2: send $27=2"),
    ],
)
def test_a_wrong_setting_is_named_with_the_line_to_send(number: int, value: float | None, words: str) -> None:
    found = required_settings(RigBoard())
    if value is None:
        del found[number]
    else:
        found[number] = value
    with pytest.raises(RefusedInput) as refused:
        check_settings(found, RigBoard(), "board at COM3")
    assert str(refused.value) == f"board at COM3: {words}"


def test_homing_is_switched_on_before_soft_limits() -> None:
    lines = setup_lines(RigBoard())
    assert lines.index("$22=1") < lines.index("$20=1")


def test_lines_are_as_short_as_they_can_be() -> None:
    assert setting_line(100, 80.0) == "$100=80"
    assert setting_line(24, 120.5) == "$24=120.5"
    assert setting_line(30, 1000.0) == "$30=1000"

"""Every alarm and error of the firmware's documentation has its words."""

import pytest

from footscan.capture.grbl.codes import ALARMS, ERRORS, SETTINGS, alarm_in_words, error_in_words


def test_all_numbers_are_known() -> None:
    assert set(ALARMS) == set(range(1, 12))
    assert set(ERRORS) == {*range(1, 18), *range(20, 39)}
    assert {0, 1, 2, 3, 4, 5, 6, 10, 11, 12, 13, *range(20, 28), 30, 31, 32} <= set(SETTINGS)
    assert {base + axis for base in (100, 110, 120, 130) for axis in range(3)} <= set(SETTINGS)


@pytest.mark.parametrize("number", sorted(ALARMS))
def test_alarms_say_what_happened_and_what_to_do(number: int) -> None:
    assert alarm_in_words(number) == f"{ALARMS[number].what}; {ALARMS[number].remedy} (alarm {number})"
    assert len({meaning.what for meaning in ALARMS.values()}) == len(ALARMS)


@pytest.mark.parametrize("number", sorted(ERRORS))
def test_errors_say_what_was_wrong_and_what_to_do(number: int) -> None:
    assert error_in_words(number) == f"{ERRORS[number].what}; {ERRORS[number].remedy} (error {number})"
    assert len({meaning.what for meaning in ERRORS.values()}) == len(ERRORS)


def test_numbers_of_a_later_firmware() -> None:
    assert alarm_in_words(99).endswith("(alarm 99)")
    assert error_in_words(99).endswith("(error 99)")

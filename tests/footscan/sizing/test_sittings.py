"""Which of a person's scans are taken together."""

from collections.abc import Callable

import pytest

from footscan.sizing.sittings import feet_left_out, latest_changes, latest_pair
from schemas.base.errors import RefusedInput
from schemas.feet import Foot

MakeFoot = Callable[..., Foot]


def scans(make_foot: MakeFoot, *names: str, **told: str) -> list[Foot]:
    """Feet whose scans' names end in the side: 2026-05-20-L."""
    sides = {"L": "left", "R": "right"}
    return [make_foot(sides[name[-1]], scan=name, source=name, **told) for name in names]


def names(feet: tuple[Foot, Foot] | list[Foot]) -> list[str | None]:
    return [foot.scan for foot in feet]


def test_the_latest_day_that_has_both_feet(make_foot: MakeFoot) -> None:
    feet = scans(make_foot, "2026-05-20-L", "2026-05-20-R", "2026-11-20-R", "2026-11-20-L", "2026-12-01-R", "first-R")
    assert names(latest_pair("P1", feet)) == ["2026-11-20-L", "2026-11-20-R"]
    assert names(feet_left_out(feet, latest_pair("P1", feet))) == ["2026-12-01-R", "first-R"]


def test_without_days_the_only_two_feet(make_foot: MakeFoot) -> None:
    feet = scans(make_foot, "foot-R", "foot-L")
    assert names(latest_pair("P1", feet)) == ["foot-L", "foot-R"]
    assert feet_left_out(feet, feet) == []


def test_a_scan_that_was_not_measured_does_not_count(make_foot: MakeFoot) -> None:
    feet = [
        *scans(make_foot, "2026-11-20-L", "2026-11-20b-R"),
        *scans(make_foot, "2026-11-20-R", finding="it is a block"),
    ]
    assert names(latest_pair("P1", feet)) == ["2026-11-20-L", "2026-11-20b-R"]


def test_two_scans_of_one_foot_and_day_are_not_chosen_from(make_foot: MakeFoot) -> None:
    feet = scans(make_foot, "2026-05-20-L", "2026-11-20-L", "2026-11-20b-L", "2026-11-20-R")
    said = "P1: has several left feet of one day, 2026-11-20-L and 2026-11-20b-L: expected one, or two scans by name"
    for chosen in (latest_pair, latest_changes):
        with pytest.raises(RefusedInput) as caught:
            chosen("P1", feet)
        assert str(caught.value) == said


def test_one_foot_alone_is_no_pair(make_foot: MakeFoot) -> None:
    with pytest.raises(RefusedInput, match=r"^P1: has no day with measures of both feet"):
        latest_pair("P1", scans(make_foot, "2026-05-20-L", "2026-11-20-R"))
    with pytest.raises(RefusedInput, match=r"^P1: has no day with measures of both feet"):
        latest_pair("P1", [])


def test_each_foot_changes_between_its_own_last_two_days(make_foot: MakeFoot) -> None:
    feet = scans(make_foot, "2026-11-20-L", "2026-05-20-L", "2026-11-20-R", "2025-05-20-L", "2026-12-01-R")
    left, right = latest_changes("P1", feet)
    assert (names(left), names(right)) == (["2026-05-20-L", "2026-11-20-L"], ["2026-11-20-R", "2026-12-01-R"])
    with pytest.raises(RefusedInput, match=r"^P1: has no foot with measures of two days"):
        latest_changes("P1", scans(make_foot, "a-L", "b-L", "2026-11-20-L"))

"""Scans of a person that belong together: both feet of one day, or one foot on two days."""

from collections.abc import Iterable, Sequence
from datetime import date

from schemas.base.errors import RefusedInput
from schemas.feet import Foot


def latest_pair(patient: str, feet: Sequence[Foot]) -> tuple[Foot, Foot]:
    """Find the left and the right foot of the latest day that has both; without dates, the only left and right foot.

    Scans that were not measured are left out, and so are scans without a date if others have one. Messages name
    `patient`.

    Raises
    ------
    RefusedInput
        No day has both feet, or the latest such day has several scans of one foot.
    """
    days = _days(feet)
    latest_first: list[date | None] = [*sorted((day for day in days if day), reverse=True)]
    for day in latest_first or [None]:
        left, right = (_of_side(days.get(day, []), side) for side in ("left", "right"))
        if left and right:
            return _only(patient, left), _only(patient, right)
    raise RefusedInput(patient, "has no day with measures of both feet, expected a left and a right one")


def latest_changes(patient: str, feet: Sequence[Foot]) -> list[tuple[Foot, Foot]]:
    """Find for each side the earlier and the later foot of the last two days on which it was measured.

    Raises
    ------
    RefusedInput
        Neither foot has scans of two days, by the dates in their names, or one of those days has several scans of it.
    """
    changes = []
    for side in ("left", "right"):
        days = _days(_of_side(feet, side))
        last = sorted(day for day in days if day)[-2:]
        if len(last) == 2:
            earlier, later = (_only(patient, days[day]) for day in last)
            changes.append((earlier, later))
    if not changes:
        raise RefusedInput(patient, "has no foot with measures of two days, expected names of scans that hold the day")
    return changes


def feet_left_out(feet: Iterable[Foot], taken: Sequence[Foot]) -> list[Foot]:
    """Feet that were not `taken` although they are no older than the oldest one taken, or have no date."""
    oldest = min((foot.date for foot in taken if foot.date), default=None)
    return [foot for foot in feet if foot not in taken and (foot.date is None or oldest is None or foot.date >= oldest)]


def _days(feet: Iterable[Foot]) -> dict[date | None, list[Foot]]:
    days: dict[date | None, list[Foot]] = {}
    for foot in feet:
        if foot.finding is None:
            days.setdefault(foot.date, []).append(foot)
    return days


def _of_side(feet: Iterable[Foot], side: str) -> list[Foot]:
    return [foot for foot in feet if foot.side == side]


def _only(patient: str, feet: Sequence[Foot]) -> Foot:
    if len(feet) > 1:
        names = " and ".join(foot.scan or foot.source for foot in feet)
        side = feet[0].side
        raise RefusedInput(patient, f"has several {side} feet of one day, {names}: expected one, or two scans by name")
    return feet[0]

"""Which scans of a person belong together: both feet of one day, and one foot on two days."""

from collections.abc import Iterable, Sequence
from datetime import date

from schemas.base.errors import RefusedInput
from schemas.feet import Foot


def latest_pair(patient: str, feet: Sequence[Foot]) -> tuple[Foot, Foot]:
    """The left and the right foot of the latest day that has both; without any days, the only ones that there are.

    A scan that was not measured does not count, nor one without a day where others have one. `patient` is what a
    message calls them.

    Raises
    ------
    RefusedInput
        No day has both feet, or that day has one of them twice.
    """
    days = _days(feet)
    told: list[date | None] = [*sorted((day for day in days if day), reverse=True)]
    for day in told or [None]:
        left, right = (_of_side(days.get(day, []), side) for side in ("left", "right"))
        if left and right:
            return _only(patient, left), _only(patient, right)
    raise RefusedInput(patient, "has no day with measures of both feet, expected a left and a right one")


def latest_changes(patient: str, feet: Sequence[Foot]) -> list[tuple[Foot, Foot]]:
    """Earlier and later of the last two days on which the left, and on which the right foot was measured.

    Raises
    ------
    RefusedInput
        Neither foot has two days that the names of its scans tell, or one of those days has the foot twice.
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


def passed_over(feet: Iterable[Foot], taken: Sequence[Foot]) -> list[Foot]:
    """Those that a user may wonder about: they are no older than what was `taken`, or have no day."""
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

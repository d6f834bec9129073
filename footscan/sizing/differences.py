"""The difference of one measure in two measurements."""

import math
from typing import NamedTuple

from footscan.sizing.readings import doubt, notes
from schemas.feet import Foot, Reading

OF_THE_SCAN = {"scan_height"}
"""Measures that tell how the scan was taken, not what the foot is like."""


class Difference(NamedTuple):
    """Second minus first."""

    value: float | None
    uncertainty: float | None
    """One standard deviation, where both measures tell theirs."""
    note: str | None
    """Why there is no difference, or what to hold against it."""


def difference(name: str, first: Reading | None, second: Reading | None, called: tuple[str, str]) -> Difference:
    """Second minus first of the measure `name`; `called` is what to call the two measurements."""
    if first is None or second is None or first.value is None or second.value is None:
        return Difference(None, None, notes(_missing(first, called[0]), _missing(second, called[1])))
    if first.unit != second.unit:
        return Difference(None, None, f"in {first.unit} and in {second.unit}")
    uncertainty = None
    if first.uncertainty is not None and second.uncertainty is not None:
        uncertainty = round(math.hypot(first.uncertainty, second.uncertainty), 4)
    doubted = [f"{what}: {said}" for reading, what in zip((first, second), called, strict=True)
               if (said := doubt(name, reading))]  # fmt: skip
    return Difference(round(second.value - first.value, 4), uncertainty, notes(*doubted))


def measures_of(first: Foot, second: Foot) -> list[str]:
    """Names of the measures of either foot, in their order."""
    return [name for name in dict.fromkeys([*first.measures, *second.measures]) if name not in OF_THE_SCAN]


def unit_of(first: Reading | None, second: Reading | None) -> str:
    """Of the measurement that has the measure."""
    return first.unit if first is not None else second.unit if second is not None else ""


def _missing(reading: Reading | None, what: str) -> str | None:
    if reading is None:
        return f"{what}: not measured"
    if reading.value is None:
        return f"{what}: incomplete" + (f": {reading.note}" if reading.note else "")
    return None

"""The difference of one measure in two measurements."""

import math
from typing import NamedTuple

from footscan.sizing.readings import doubt, notes
from schemas.feet import Foot, Reading

SCAN_MEASURES = {"scan_height"}
"""Measures of the scan, not of the foot"""


class Difference(NamedTuple):
    """Second minus first measurement, in their unit."""

    value: float | None
    uncertainty: float | None
    """One standard deviation; None if that of one measurement is unknown"""
    note: str | None
    """Why there is no difference, or why it is doubtful"""


def difference(name: str, first: Reading | None, second: Reading | None, labels: tuple[str, str]) -> Difference:
    """Second minus first reading of the measure `name`; `labels` are the names of the two measurements in notes."""
    if first is None or second is None or first.value is None or second.value is None:
        return Difference(None, None, notes(_missing(first, labels[0]), _missing(second, labels[1])))
    if first.unit != second.unit:
        return Difference(None, None, f"in {first.unit} and in {second.unit}")
    uncertainty = None
    if first.uncertainty is not None and second.uncertainty is not None:
        uncertainty = round(math.hypot(first.uncertainty, second.uncertainty), 4)
    doubts = [
        f"{label}: {text}"
        for reading, label in zip((first, second), labels, strict=True)
        if (text := doubt(name, reading))
    ]
    return Difference(round(second.value - first.value, 4), uncertainty, notes(*doubts))


def measures_of(first: Foot, second: Foot) -> list[str]:
    """Names of the measures of either foot, in their order, without those of the scan."""
    return [name for name in dict.fromkeys([*first.measures, *second.measures]) if name not in SCAN_MEASURES]


def unit_of(first: Reading | None, second: Reading | None) -> str:
    """Unit of the first reading, or else of the second; empty without readings."""
    return first.unit if first is not None else second.unit if second is not None else ""


def _missing(reading: Reading | None, label: str) -> str | None:
    if reading is None:
        return f"{label}: not measured"
    if reading.value is None:
        return f"{label}: incomplete" + (f": {reading.note}" if reading.note else "")
    return None

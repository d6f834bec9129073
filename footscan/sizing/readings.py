"""Measures of a foot that can be used for sizing: a value in mm, or the reason why there is none."""

import difflib
from collections.abc import Mapping
from typing import NamedTuple

from schemas.feet import Foot, Reading

RANGE_MM = 10.0, 1000.0
"""Lengths and girths that are accepted for any foot; whether there are shoes for it depends on the scales. Chosen by
hand."""
FOOT_LENGTH_MM = 60.0, 500.0
"""Foot lengths that are accepted as mm; those in cm or inches lie below. Chosen by hand."""


class UsableMeasure(NamedTuple):
    """One measure of a foot in mm, or the reason why there is none."""

    mm: float | None
    note: str | None
    """Why there is no value, or why it is uncertain"""


def usable_measure(foot: Foot, name: str) -> UsableMeasure:
    """The length or girth `name` of `foot`."""
    reading = foot.measures.get(name)
    if reading is None:
        return UsableMeasure(None, _missing(foot, name))
    if reading.value is None:
        return UsableMeasure(None, f"{name} is incomplete" + (f": {reading.note}" if reading.note else ""))
    least, greatest = FOOT_LENGTH_MM if name == "foot_length" else RANGE_MM
    if reading.unit != "mm" or not least <= reading.value <= greatest:
        return UsableMeasure(None, f"{name} is {reading.value:g} {reading.unit}, expected {least:g} to {greatest:g} mm")
    return UsableMeasure(reading.value, doubt(name, reading))


def _missing(foot: Foot, name: str) -> str:
    if foot.finding:
        return f"nothing was measured: {foot.finding}"
    near = difflib.get_close_matches(name, foot.measures, n=1, cutoff=0.8)
    return f"no {name} was measured" + (f", but there is {near[0]!r}" if near else "")


def doubt(name: str, reading: Reading) -> str | None:
    """Why a measure with a value is uncertain; None if it is not."""
    if reading.status != "uncertain":
        return None
    return f"{name} is uncertain" + (f": {reading.note}" if reading.note else "")


def notes(*parts: str | None) -> str | None:
    """Join the distinct notes that are not empty by "; "; None if there are none.

    >>> notes("a gap", None, "a fallback", "a gap")
    'a gap; a fallback'
    """
    return "; ".join(dict.fromkeys(part for part in parts if part)) or None


UsableMeasures = Mapping[str, UsableMeasure]

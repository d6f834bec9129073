"""Measures as something to count with: a value in mm, or the reason why there is none."""

import difflib
from collections.abc import Mapping
from typing import NamedTuple

from schemas.feet import Foot, Reading

RANGE_MM = 10.0, 1000.0
"""Of a length or girth of any foot; whether there are shoes for it the scales say."""
FOOT_LENGTH_MM = 60.0, 500.0
"""Beyond, it is not in mm: centimetres and inches lie below."""


class Known(NamedTuple):
    """One measure of a foot."""

    mm: float | None
    note: str | None
    """Why there is no value; or why it is uncertain."""


def known(foot: Foot, name: str) -> Known:
    """A length or girth of `foot`, mm."""
    reading = foot.measures.get(name)
    if reading is None:
        return Known(None, _missing(foot, name))
    if reading.value is None:
        return Known(None, f"{name} is incomplete" + (f": {reading.note}" if reading.note else ""))
    least, greatest = FOOT_LENGTH_MM if name == "foot_length" else RANGE_MM
    if reading.unit != "mm" or not least <= reading.value <= greatest:
        return Known(None, f"{name} is {reading.value:g} {reading.unit}, expected {least:g} to {greatest:g} mm")
    return Known(reading.value, doubt(name, reading))


def _missing(foot: Foot, name: str) -> str:
    if foot.finding:
        return f"nothing was measured: {foot.finding}"
    near = difflib.get_close_matches(name, foot.measures, n=1, cutoff=0.8)
    return f"no {name} was measured" + (f", but there is {near[0]!r}" if near else "")


def doubt(name: str, reading: Reading) -> str | None:
    """Why a measure that is there is uncertain."""
    if reading.status != "uncertain":
        return None
    return f"{name} is uncertain" + (f": {reading.note}" if reading.note else "")


def notes(*parts: str | None) -> str | None:
    """All that is to be said, each once; None where that is nothing."""
    return "; ".join(dict.fromkeys(part for part in parts if part)) or None


KnownMeasures = Mapping[str, Known]

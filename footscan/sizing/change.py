"""Changes between two measurements of one foot, and which of them may be chance."""

import math

from footscan.sizing.differences import Difference, difference, measures_of, unit_of
from footscan.sizing.identity import doubts, refuse_other_foot, sighting
from footscan.sizing.readings import notes
from schemas.feet import Foot
from schemas.pairs import Change, ChangeRow
from schemas.sizes import Repeatability, SizeTable

CONFIDENCE_95 = 1.96
"""95 % of a normal distribution lie within this number of standard deviations."""


def change_over_time(earlier: Foot, later: Foot, table: SizeTable) -> Change:
    """Compare two measurements of one foot: later minus earlier, each with the smallest real change.

    Raises
    ------
    RefusedInput
        One foot is a left and one a right foot, or `earlier` is the later one.
    """
    refuse_other_foot(earlier, later)
    days = (later.date - earlier.date).days if earlier.date and later.date else None
    return Change(
        earlier=sighting(earlier),
        later=sighting(later),
        days=days,
        rows=[_row(name, earlier, later, table.repeatability) for name in measures_of(earlier, later)],
        notes=doubts(earlier, later),
    )


def smallest_real_change(name: str, unit: str, uncertainty: float | None, repeatability: Repeatability) -> float | None:
    """The MDC95 in mm: 1.96 sqrt(2) times the standard error of one measurement, plus the uncertainty of both meshes.

    None if the scatter from scan to scan is unknown: the uncertainty of a mesh does not include how the foot stood.
    """
    sem = repeatability.girths_mm if name.endswith("_girth") else repeatability.lengths_mm
    if unit != "mm" or sem is None:
        return None
    return round(CONFIDENCE_95 * math.hypot(math.sqrt(2) * sem, uncertainty or 0.0), 4)


def _row(name: str, earlier: Foot, later: Foot, repeatability: Repeatability) -> ChangeRow:
    a, b = earlier.measures.get(name), later.measures.get(name)
    change = difference(name, a, b, ("earlier", "later"))
    unit = unit_of(a, b)
    limit = None if change.value is None else smallest_real_change(name, unit, change.uncertainty, repeatability)
    is_redefined = a is not None and b is not None and a.definition != b.definition
    return ChangeRow(
        measure=name,
        unit=unit,
        earlier=a.value if a else None,
        later=b.value if b else None,
        difference=change.value,
        uncertainty=change.uncertainty,
        limit=limit,
        significant=None if is_redefined else _is_real(change, limit),
        note=notes(change.note, "the definition changed" if is_redefined and change.value is not None else None),
    )


def _is_real(change: Difference, limit: float | None) -> bool | None:
    return None if change.value is None or limit is None else abs(change.value) > limit

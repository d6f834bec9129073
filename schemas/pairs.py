"""Two measurements side by side: the feet of a person, or one foot at two times."""

from datetime import date

from schemas.base.model import Document, Side
from schemas.sizes import Sizes


class Sighting(Document):
    """Which measurement."""

    source: str
    patient: str | None
    scan: str | None
    side: Side
    date: date | None


class PairRow(Document):
    """One measure of both feet."""

    measure: str
    unit: str
    left: float | None
    right: float | None
    difference: float | None
    """Right minus left."""
    uncertainty: float | None
    """Of the difference, one standard deviation; None where the measures tell none."""
    larger: Side | None
    """None where they are equal, or one is missing."""
    usual_sds: float | None
    """The difference in standard deviations of that over people."""
    note: str | None


class Pair(Document):
    """Both feet of a person."""

    left: Sighting
    right: Sighting
    rows: list[PairRow]
    decided_by: dict[str, Side | None]
    """Which foot each measure that sizes need was taken of: the larger one; None where both are alike or one foot
    has none."""
    sizes: Sizes
    notes: list[str]


class ChangeRow(Document):
    """One measure at two times."""

    measure: str
    unit: str
    earlier: float | None
    later: float | None
    difference: float | None
    """Later minus earlier."""
    uncertainty: float | None
    """Of the difference, one standard deviation, by the measures themselves; None where they tell none."""
    limit: float | None
    """Smallest difference that is none by chance (95 %)."""
    significant: bool | None
    """None where no limit is known, or the measures cannot be compared."""
    note: str | None


class Change(Document):
    """One foot at two times."""

    earlier: Sighting
    later: Sighting
    days: int | None
    rows: list[ChangeRow]
    notes: list[str]

"""Both feet of a person: how they differ, and the sizes that fit both."""

from footscan.sizing.differences import difference, measures_of, unit_of
from footscan.sizing.identity import doubts, refuse_sides, sighting
from footscan.sizing.readings import Known, known, notes
from footscan.sizing.sizes import NEEDED, sizes_of
from schemas.base.model import Side
from schemas.feet import Foot
from schemas.pairs import Pair, PairRow
from schemas.sizes import Asymmetry, People, SizeTable


def compare_pair(left: Foot, right: Foot, table: SizeTable, people: People | None = None) -> Pair:
    """Differences of both feet, right minus left, and the sizes of shoes for both.

    The longer foot decides the size, the wider one the width: of every measure the larger one is taken.

    Raises
    ------
    RefusedInput
        `left` is a right foot, or `right` a left one.
    """
    refuse_sides(left, right)
    deciding = {name: _larger(name, left, right) for name in NEEDED}
    return Pair(
        left=sighting(left),
        right=sighting(right),
        rows=[_row(name, left, right, table.left_right) for name in measures_of(left, right)],
        decided_by={name: side for name, (_, side) in deciding.items()},
        sizes=sizes_of({name: measured for name, (measured, _) in deciding.items()}, table, people),
        notes=doubts(left, right),
    )


def _larger(name: str, left: Foot, right: Foot) -> tuple[Known, Side | None]:
    """The larger of both feet's measures, and whose it is where they differ; none where one foot has none, for it may
    be larger."""
    ours: dict[Side, Known] = {"left": known(left, name), "right": known(right, name)}
    missing = [f"{side} foot: {one.note}" for side, one in ours.items() if one.mm is None]
    if missing:
        return Known(None, notes(*missing)), None
    side = max(ours, key=lambda one: ours[one].mm or 0.0)
    note = ours[side].note
    larger = Known(ours[side].mm, f"{side} foot: {note}" if note else None)
    return larger, None if ours["left"].mm == ours["right"].mm else side


def _row(name: str, left: Foot, right: Foot, asymmetry: Asymmetry) -> PairRow:
    a, b = left.measures.get(name), right.measures.get(name)
    found = difference(name, a, b, ("left foot", "right foot"))
    sd = asymmetry.sd_mm.get(name)
    sds = None if found.value is None or sd is None else round(abs(found.value) / sd, 2)
    is_unusual = sds is not None and sds > asymmetry.unusual_beyond
    return PairRow(
        measure=name,
        unit=unit_of(a, b),
        left=a.value if a else None,
        right=b.value if b else None,
        difference=found.value,
        uncertainty=found.uncertainty,
        larger=None if not found.value else "right" if found.value > 0 else "left",
        usual_sds=sds,
        note=notes(found.note, f"unusual: {sds:.1f} standard deviations over people" if is_unusual else None),
    )

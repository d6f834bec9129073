"""Both feet of a person: their differences, and the sizes that fit both."""

from footscan.sizing.differences import difference, measures_of, unit_of
from footscan.sizing.identity import doubts, refuse_sides, sighting
from footscan.sizing.readings import UsableMeasure, notes, usable_measure
from footscan.sizing.sizes import NEEDED, sizes_of
from schemas.base.model import Side
from schemas.feet import Foot
from schemas.pairs import Pair, PairRow
from schemas.sizes import Asymmetry, People, SizeTable


def compare_pair(left: Foot, right: Foot, table: SizeTable, people: People | None = None) -> Pair:
    """Compare both feet, right minus left, and compute the sizes of shoes for both.

    The longer foot decides the size, the wider one the width: the larger value of every measure is taken.

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


def _larger(name: str, left: Foot, right: Foot) -> tuple[UsableMeasure, Side | None]:
    """Returns the larger value of a measure, and the side that has it if the values differ.

    Without a value of one foot there is no larger one, since the missing value may be it.
    """
    by_side: dict[Side, UsableMeasure] = {"left": usable_measure(left, name), "right": usable_measure(right, name)}
    missing = [f"{side} foot: {measure.note}" for side, measure in by_side.items() if measure.mm is None]
    if missing:
        return UsableMeasure(None, notes(*missing)), None
    side = max(by_side, key=lambda side: by_side[side].mm or 0.0)
    note = by_side[side].note
    larger = UsableMeasure(by_side[side].mm, f"{side} foot: {note}" if note else None)
    return larger, None if by_side["left"].mm == by_side["right"].mm else side


def _row(name: str, left: Foot, right: Foot, asymmetry: Asymmetry) -> PairRow:
    a, b = left.measures.get(name), right.measures.get(name)
    right_minus_left = difference(name, a, b, ("left foot", "right foot"))
    sd = asymmetry.sd_mm.get(name)
    sds = None if right_minus_left.value is None or sd is None else round(abs(right_minus_left.value) / sd, 2)
    is_unusual = sds is not None and sds > asymmetry.unusual_beyond
    unusual = f"unusual: {sds:.1f} standard deviations over people" if is_unusual else None
    return PairRow(
        measure=name,
        unit=unit_of(a, b),
        left=a.value if a else None,
        right=b.value if b else None,
        difference=right_minus_left.value,
        uncertainty=right_minus_left.uncertainty,
        larger=None if not right_minus_left.value else "right" if right_minus_left.value > 0 else "left",
        usual_sds=sds,
        note=notes(right_minus_left.note, unusual),
    )

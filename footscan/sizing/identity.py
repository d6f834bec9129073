"""Whose feet they are: what may stand side by side, and what is a mix-up."""

from schemas.base.errors import RefusedInput
from schemas.feet import Foot
from schemas.pairs import Sighting


def sighting(foot: Foot) -> Sighting:
    """What identifies a measurement."""
    return Sighting(source=foot.source, patient=foot.patient, scan=foot.scan, side=foot.side, date=foot.date)


def refuse_other_patient(first: Foot, second: Foot) -> None:
    """Refuses feet of two people, as far as the patients are known.

    Raises
    ------
    RefusedInput
    """
    if first.patient and second.patient and first.patient != second.patient:
        problem = f"is of patient {second.patient}, expected {first.patient} as {first.source} is"
        raise RefusedInput(second.source, problem)


def refuse_sides(left: Foot, right: Foot) -> None:
    """Refuses a pair whose left foot is a right one, or the other way round; an unknown side is taken as said.

    Raises
    ------
    RefusedInput
    """
    if left.side == "right" and right.side == "left":
        raise RefusedInput(left.source, "is a right foot, expected the left one first")
    for foot, side in ((left, "left"), (right, "right")):
        if foot.side not in {side, "unknown"}:
            raise RefusedInput(foot.source, f"is a {foot.side} foot, expected a {side} one")


def refuse_other_foot(earlier: Foot, later: Foot) -> None:
    """Refuses a left foot beside a right one, and a later measurement before an earlier one.

    Raises
    ------
    RefusedInput
    """
    if {earlier.side, later.side} == {"left", "right"}:
        raise RefusedInput(
            later.source, f"is a {later.side} foot, expected a {earlier.side} one as {earlier.source} is"
        )
    if earlier.date and later.date and earlier.date > later.date:
        raise RefusedInput(earlier.source, f"is of {earlier.date}, expected the earlier one first ({later.date})")


def doubts(first: Foot, second: Foot) -> list[str]:
    """What cannot be told of two measurements that should be of one person and alike."""
    told = [f"{foot.source}: side unknown, taken as said" for foot in (first, second) if foot.side == "unknown"]
    told += [f"{foot.source}: {foot.side_note}" for foot in (first, second) if foot.side_note]
    if not (first.patient and second.patient):
        told.append("patient not known of both, taken as one")
    elif first.patient != second.patient:
        told.append(f"of two patients: {first.patient} and {second.patient}")
    if first.axis != second.axis:
        told.append(f"measured along other axes: {first.axis} and {second.axis}")
    return told

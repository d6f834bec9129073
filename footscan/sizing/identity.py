"""Identity of measured feet: refusal of mixed-up patients, sides and dates."""

from schemas.base.errors import RefusedInput
from schemas.feet import Foot
from schemas.pairs import Sighting


def sighting(foot: Foot) -> Sighting:
    """Source, patient, scan, side and date of a measurement."""
    return Sighting(source=foot.source, patient=foot.patient, scan=foot.scan, side=foot.side, date=foot.date)


def refuse_other_patient(first: Foot, second: Foot) -> None:
    """Refuse feet of two patients, if both patients are known.

    Raises
    ------
    RefusedInput
        The patients differ.
    """
    if first.patient and second.patient and first.patient != second.patient:
        problem = f"is of patient {second.patient}, expected {first.patient} as {first.source} is"
        raise RefusedInput(second.source, problem)


def refuse_sides(left: Foot, right: Foot) -> None:
    """Refuse a pair whose left foot is a right one, or vice versa; an unknown side is assumed as stated.

    Raises
    ------
    RefusedInput
        A foot is of the other side.
    """
    if left.side == "right" and right.side == "left":
        raise RefusedInput(left.source, "is a right foot, expected the left one first")
    for foot, side in ((left, "left"), (right, "right")):
        if foot.side not in {side, "unknown"}:
            raise RefusedInput(foot.source, f"is a {foot.side} foot, expected a {side} one")


def refuse_other_foot(earlier: Foot, later: Foot) -> None:
    """Refuse a comparison of a left with a right foot, or of a later measurement with an earlier one.

    Raises
    ------
    RefusedInput
        The sides differ, or the dates are in the wrong order.
    """
    if {earlier.side, later.side} == {"left", "right"}:
        raise RefusedInput(
            later.source, f"is a {later.side} foot, expected a {earlier.side} one as {earlier.source} is"
        )
    if earlier.date and later.date and earlier.date > later.date:
        raise RefusedInput(earlier.source, f"is of {earlier.date}, expected the earlier one first ({later.date})")


def doubts(first: Foot, second: Foot) -> list[str]:
    """Reasons to doubt that two measurements are of one person and comparable."""
    feet = (first, second)
    reasons = [f"{foot.source}: side unknown, assumed as stated" for foot in feet if foot.side == "unknown"]
    reasons += [f"{foot.source}: {foot.side_note}" for foot in feet if foot.side_note]
    if not (first.patient and second.patient):
        reasons.append("patient unknown for one or both, assumed to be the same")
    elif first.patient != second.patient:
        reasons.append(f"of two patients: {first.patient} and {second.patient}")
    if first.axis != second.axis:
        reasons.append(f"measured along different axes: {first.axis} and {second.axis}")
    if first.posture != second.posture:
        reasons.append(_other_posture(first, second))
    return reasons


def _other_posture(first: Foot, second: Foot) -> str:
    postures = f"{first.source}: {first.posture}, {second.source}: {second.posture}"
    known = "not known for both" if "unknown" in {first.posture, second.posture} else "not the same"
    return (
        f"the posture is {known} ({postures}): a foot grows under load, so differences may come from the posture; scan "
        "both in one posture, and state it"
    )

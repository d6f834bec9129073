"""Ranking of lasts for a foot or a pair."""

from collections.abc import Iterable, Mapping, Sequence

from footscan.sizing.readings import Known, known
from schemas.base.errors import RefusedInput
from schemas.feet import Foot
from schemas.lasts import Allowance, Deviation, Last, LastFit, LastMeasure, LastRules, LastSide, RankedLast, Ranking

OF_FOOT: dict[LastMeasure, str] = {
    "length": "foot_length",
    "ball_length": "ball_length",
    "ball_girth": "ball_girth",
    "waist_girth": "waist_girth",
    "instep_girth": "instep_girth",
    "heel_girth": "heel_girth",
}
INDISPENSABLE: tuple[LastMeasure, ...] = ("length", "ball_girth")
"""Without these of the foot no last can be chosen."""
PREFERRED: dict[str, tuple[LastSide, ...]] = {
    "left": ("left", "both", "right"),
    "right": ("right", "both", "left"),
    "foot": ("both", "right", "left"),
}
"""Which last of a group is for a foot of which side."""
Allowances = Mapping[LastMeasure, Allowance]
SidedLasts = Mapping[LastSide, Last]
"""A last, or the left and the right one of a pair of lasts."""
Measured = Mapping[LastMeasure, Known]
"""Of a foot."""


def rank_lasts(feet: Sequence[Foot], lasts: Iterable[Last], rules: LastRules, purpose: str) -> Ranking:
    """Lasts for one foot or both feet of a person, the best first, those that are out at the end.

    Each is held beside each foot; what lies outside what the purpose allows counts with weight times its square, and of
    a pair the worse foot counts. Among lasts that fit alike the one of which more was compared is first, then the one
    nearest to the middle of what is allowed.
    A last of the other side is mirrored, unless its partner is there.

    Raises
    ------
    RefusedInput
        The purpose is not in the table, two feet are of one side, or a foot lacks its length or its ball girth.
    """
    if purpose not in rules.purposes:
        raise RefusedInput("purpose", f"expected one of {', '.join(rules.purposes)}, found {purpose!r}")
    allowances = rules.purposes[purpose]
    by_side = _by_side(feet)
    measured = {side: _measured(foot) for side, foot in by_side.items()}
    beside = [
        {side: _fit(side, group, foot, allowances, rules) for side, foot in measured.items()}
        for group in _groups(lasts)
    ]
    beside.sort(key=_order)
    return Ranking(
        purpose=purpose,
        sides=[foot.side for foot in feet],
        missing=[
            f"{side}: {measure.note}"
            for side, foot in measured.items()
            for name, measure in foot.items()
            if measure.mm is None and name in allowances
        ],
        lasts=[_ranked(fits, place) for place, fits in enumerate(beside, 1)],
    )


def _by_side(feet: Sequence[Foot]) -> dict[str, Foot]:
    if len(feet) == 1:
        [foot] = feet
        return {"foot" if foot.side == "unknown" else foot.side: foot}
    if len(feet) != 2 or {foot.side for foot in feet} != {"left", "right"}:
        sides = ", ".join(foot.side for foot in feet)
        raise RefusedInput(feet[-1].source, f"expected one foot, or a left and a right one, found {sides}")
    return {foot.side: foot for foot in sorted(feet, key=lambda foot: foot.side)}


def _groups(lasts: Iterable[Last]) -> list[SidedLasts]:
    """Lasts of one name, article, size and fullness together: its left and its right one may differ."""
    groups: dict[tuple[str | None, ...], dict[LastSide, Last]] = {}
    for last in lasts:
        groups.setdefault((last.name, last.article, last.size, last.fullness), {})[last.side] = last
    return list(groups.values())


def _measured(foot: Foot) -> Measured:
    measured = {name: known(foot, of_foot) for name, of_foot in OF_FOOT.items()}
    for name in INDISPENSABLE:
        if measured[name].mm is None:
            raise RefusedInput(foot.source, f"{measured[name].note}, expected it to choose a last by")
    return measured


def _fit(side: str, group: SidedLasts, foot: Measured, allowances: Allowances, rules: LastRules) -> LastFit:
    """The last of a group that is for `side`, beside that foot."""
    last = next(group[one] for one in PREFERRED[side] if one in group)
    deviations: dict[LastMeasure, Deviation] = {}
    score = distance = 0.0
    for name, allowance in allowances.items():
        of_foot = foot[name].mm
        if of_foot is None or name not in last.measures:
            continue
        difference = last.measures[name] - of_foot
        outside = difference - min(max(difference, allowance.from_mm), allowance.to_mm)
        score += allowance.weight * outside**2
        distance += allowance.weight * (difference - (allowance.from_mm + allowance.to_mm) / 2) ** 2
        deviations[name] = Deviation(
            last=last.measures[name], foot=of_foot, difference=round(difference, 4), outside=round(outside, 4)
        )
    return LastFit(
        last=last,
        mirrored={side, last.side} == {"left", "right"},
        deviations=deviations,
        not_compared=[name for name in allowances if name not in deviations],
        score=round(score, 4),
        distance=round(distance, 4),
        rejected=_rejections(last, foot, rules),
    )


def _rejections(last: Last, foot: Measured, rules: LastRules) -> list[str]:
    found = []
    for name, least in rules.reject_below_mm.items():
        of_foot = foot[name].mm
        if of_foot is None or name not in last.measures:
            continue
        if (difference := last.measures[name] - of_foot) < least:
            found.append(f"{name} minus the foot's is {difference:+.1f} mm, expected at least {least:+g}")
    return found


def _order(fits: Mapping[str, LastFit]) -> tuple[bool, float, int, float, str, str]:
    """By the worse foot; of equal scores the one first that rests on more measures."""
    last = next(iter(fits.values())).last
    is_out = any(fit.rejected for fit in fits.values())
    score = max(fit.score for fit in fits.values())
    not_compared = max(len(fit.not_compared) for fit in fits.values())
    return is_out, score, not_compared, max(fit.distance for fit in fits.values()), last.name, last.place


def _ranked(fits: Mapping[str, LastFit], place: int) -> RankedLast:
    worse = max(fits, key=lambda side: (bool(fits[side].rejected), fits[side].score, fits[side].distance))
    is_out = any(fit.rejected for fit in fits.values())
    return RankedLast(
        name=fits[worse].last.name,
        rank=None if is_out else place,
        score=max(fit.score for fit in fits.values()),
        worse=worse,
        feet=dict(fits),
    )

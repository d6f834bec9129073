"""Ranking of lasts for a foot or a pair."""

from collections.abc import Iterable, Mapping, Sequence

from footscan.sizing.readings import UsableMeasure, usable_measure
from schemas.base.errors import RefusedInput
from schemas.feet import Foot
from schemas.lasts import Allowance, Deviation, Last, LastFit, LastMeasure, LastRules, LastSide, RankedLast, Ranking

FOOT_MEASURES: dict[LastMeasure, str] = {
    "length": "foot_length",
    "ball_length": "ball_length",
    "ball_girth": "ball_girth",
    "waist_girth": "waist_girth",
    "instep_girth": "instep_girth",
    "heel_girth": "heel_girth",
}
"""Measure of the foot for each measure of a last"""
INDISPENSABLE: tuple[LastMeasure, ...] = ("length", "ball_girth")
"""Measures of the foot without which no last can be chosen"""
PREFERRED: dict[str, tuple[LastSide, ...]] = {
    "left": ("left", "both", "right"),
    "right": ("right", "both", "left"),
    "foot": ("both", "right", "left"),
}
"""Preferred lasts of a group, in order, for a foot of each side"""
Allowances = Mapping[LastMeasure, Allowance]
SidedLasts = Mapping[LastSide, Last]
"""A last, or the left and the right one of a pair of lasts."""
Measured = Mapping[LastMeasure, UsableMeasure]
"""Measures of a foot, under the names of a last's measures"""


def rank_lasts(feet: Sequence[Foot], lasts: Iterable[Last], rules: LastRules, purpose: str) -> Ranking:
    """Rank lasts for one foot or both feet of a person, the best first, rejected ones at the end.

    The score of a last is the sum, over its measures, of weight times squared distance from the range that the purpose
    allows; for a pair, the score of the worse foot counts. Of equal scores, the last with more measures compared comes
    first, then the one nearest to the middle of the allowed ranges. A last of the other side is mirrored, unless its
    partner is in the table.

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
    fits_of_groups = [
        {side: _fit(side, group, foot, allowances, rules) for side, foot in measured.items()}
        for group in _groups(lasts)
    ]
    fits_of_groups.sort(key=_order)
    return Ranking(
        purpose=purpose,
        sides=[foot.side for foot in feet],
        missing=[
            f"{side}: {measure.note}"
            for side, foot in measured.items()
            for name, measure in foot.items()
            if measure.mm is None and name in allowances
        ],
        lasts=[_ranked(fits, place) for place, fits in enumerate(fits_of_groups, 1)],
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
    """Group lasts of one name, article, size and fullness, whose left and right one may differ."""
    groups: dict[tuple[str | None, ...], dict[LastSide, Last]] = {}
    for last in lasts:
        groups.setdefault((last.name, last.article, last.size, last.fullness), {})[last.side] = last
    return list(groups.values())


def _measured(foot: Foot) -> Measured:
    measured = {name: usable_measure(foot, of_foot) for name, of_foot in FOOT_MEASURES.items()}
    for name in INDISPENSABLE:
        if measured[name].mm is None:
            raise RefusedInput(foot.source, f"{measured[name].note}, expected it to choose a last by")
    return measured


def _fit(side: str, group: SidedLasts, foot: Measured, allowances: Allowances, rules: LastRules) -> LastFit:
    """Compare the last of a group that is for `side` with that foot."""
    last = next(group[last_side] for last_side in PREFERRED[side] if last_side in group)
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
    rejections = []
    for name, least in rules.reject_below_mm.items():
        of_foot = foot[name].mm
        if of_foot is None or name not in last.measures:
            continue
        if (difference := last.measures[name] - of_foot) < least:
            rejections.append(f"{name} minus the foot's is {difference:+.1f} mm, expected at least {least:+g}")
    return rejections


def _order(fits: Mapping[str, LastFit]) -> tuple[bool, float, int, float, str, str]:
    """Sort key: by the worse foot; of equal scores, the last with more measures compared comes first."""
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

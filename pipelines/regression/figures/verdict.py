"""Verdicts on the figures of a night, compared with the accepted ones."""

from collections.abc import Mapping, Sequence

from pipelines.regression.figures.of_scan import Goal, goal_of, measure_figure, rounded, tolerance_of
from pipelines.regression.report.result import JudgedFigure, Verdict
from schemas.regression import NightEnded, Suite

ROUNDING = 1e-9
"""Bound of the rounding error of a difference of two figures."""


def judge_figures(
    data_set: str,
    figures: Mapping[str, float | None],
    accepted: Mapping[str, float | None],
    truths: Mapping[str, float],
    suite: Suite,
    history: Sequence[NightEnded] = (),
) -> list[JudgedFigure]:
    """Judge each figure that exists or was accepted, in the order of `in_order`.

    Parameters
    ----------
    truths : true measures of the foot, mm, by name
    history : earlier nights
    """
    true_figures = {measure_figure(name, unit): value for name, value in truths.items() for unit in _UNITS}
    judged = []
    for name in sorted(figures.keys() | accepted.keys(), key=in_order):
        value, before = rounded(name, figures.get(name)), accepted.get(name)
        goal, truth = goal_of(name), true_figures.get(name)
        allowed = 0.0 if before is None else tolerance_of(data_set, name, suite).allows(before)
        nights = [night.sets.get(data_set, {}).get(name) for night in history]
        judged.append(
            JudgedFigure(
                name=name,
                value=value,
                accepted=before,
                allowed=allowed,
                better=goal,
                truth=truth,
                verdict=verdict(value, before, allowed, goal, truth, in_baseline=name in accepted),
                history=[*nights, value],
            )
        )
    return judged


def verdict(
    value: float | None, accepted: float | None, allowed: float, goal: Goal, truth: float | None, *, in_baseline: bool
) -> Verdict:
    """Judge one figure; `in_baseline` is True if the baseline has it, even as null."""
    if value is None and accepted is None:
        return "same" if in_baseline else "new"
    if value is None:
        return "missing"
    if accepted is None:
        return "better" if in_baseline else "new"  # a figure that was unknown before is known now
    gain = accepted - value
    if abs(gain) <= allowed + ROUNDING:
        return "same"
    is_better = {
        "less": gain > 0,
        "more": gain < 0,
        "nearer": truth is not None and abs(value - truth) < abs(accepted - truth) - ROUNDING,
        "same": False,
    }[goal]
    return "better" if is_better else "worse"


def in_order(figure: str) -> tuple[int, str]:
    """Sort key of a figure: the most important groups come first."""
    group = figure.partition(".")[0]
    return (_GROUPS.index(group) if group in _GROUPS else len(_GROUPS)), figure


_GROUPS = ("films", "accuracy", "measures", "cameras", "points", "surface", "steps", "time", "memory")
_UNITS = ("mm", "mm2", "mm3", "deg", "1")

"""Plots of trials as SVG: each trial is a point; the present parameters and the winner are marked."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from footscan.report.markup import number, text
from pipelines.tuning.report.result import Goal, Trial

WIDTH, HEIGHT = 360, 240
LEFT, RIGHT, TOP, BELOW = 52, 10, 8, 34
"""Margins, in units of the drawing."""
LEAST_TICKS = 3.5
"""Least number of steps between the ends of an axis; chosen by hand."""
PLAIN, FRONT, PRESENT, WINNER = "#a9b4bf", "#1f6f8b", "#d9822b", "#17632f"

Axis = tuple[str, Sequence[float], Sequence[tuple[float, str]] | None]
"""Label, value of each trial, and ticks; None: the ticks of a numeric axis."""


def trade_off(first: Goal, second: Goal, trials: Sequence[Trial], winner: Trial) -> str:
    """Plot two objectives of each trial against each other; trials in which a scan failed are left out."""
    shown = sound(trials)
    label = f"{first.name} and {second.name} of each trial"
    axes = [(_label(goal), [trial.values[goal.name] for trial in shown], None) for goal in (first, second)]
    return _scatter(label, axes[0], axes[1], shown, winner)


def course(goal: Goal, trials: Sequence[Trial], winner: Trial) -> str:
    """Plot an objective from trial to trial; trials in which a scan failed are left out."""
    shown = sound(trials)
    values = [trial.values[goal.name] for trial in shown]
    return _scatter(
        f"{goal.name} of each trial", ("trial", [trial.number for trial in shown], None), (_label(goal), values, None),
        shown, winner,
    )  # fmt: skip


def by_parameter(name: str, goal: Goal, trials: Sequence[Trial], winner: Trial) -> str:
    """Plot an objective over the values of one parameter; trials in which a scan failed are left out."""
    shown = sound(trials)
    places, ticks = _places([trial.point[name] for trial in shown])
    values = [trial.values[goal.name] for trial in shown]
    return _scatter(f"{goal.name} by {name}", (name, places, ticks), (_label(goal), values, None), shown, winner)


def sound(trials: Sequence[Trial]) -> list[Trial]:
    """The trials in which no scan failed; all trials if there are none."""
    return [trial for trial in trials if not trial.problems] or list(trials)


def _label(goal: Goal) -> str:
    return f"{goal.name}, {goal.unit}"


def _places(values: Sequence[Any]) -> tuple[list[float], list[tuple[float, str]] | None]:
    """Positions of values on an axis, and its ticks: numbers by their size, other values one after another."""
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return [float(value) for value in values], None
    names = sorted({str(value) for value in values})
    return [float(names.index(str(value))) for value in values], [(float(k), name) for k, name in enumerate(names)]


def _scatter(label: str, across: Axis, up: Axis, trials: Sequence[Trial], winner: Trial) -> str:
    x_low, x_high = _ends(across[1])
    y_low, y_high = _ends(up[1])

    def x(value: float) -> float:
        return LEFT + (value - x_low) / (x_high - x_low) * (WIDTH - LEFT - RIGHT)

    def y(value: float) -> float:
        return HEIGHT - BELOW - (value - y_low) / (y_high - y_low) * (HEIGHT - TOP - BELOW)

    drawn = sorted(zip(trials, across[1], up[1], strict=True), key=lambda row: _rank(row[0], winner))
    dots = "".join(
        f'<circle cx="{x(a):.1f}" cy="{y(b):.1f}" r="{3 + _rank(trial, winner) / 2}" fill="{_colour(trial, winner)}">'
        f"<title>{text(_caption(trial))}</title></circle>"
        for trial, a, b in drawn
    )
    marks = "".join(
        f'<text x="{x(at):.1f}" y="{HEIGHT - BELOW + 12}" text-anchor="middle">{text(name)}</text>'
        for at, name in across[2] or _ticks(x_low, x_high)
    )
    marks += "".join(
        f'<text x="{LEFT - 4}" y="{y(at) + 3:.1f}" text-anchor="end">{text(name)}</text>'
        for at, name in _ticks(y_low, y_high)
    )
    return (
        f'<figure class="trials"><svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{text(label)}">'
        f'<path fill="none" class="g5" d="M{LEFT} {TOP}V{HEIGHT - BELOW}H{WIDTH - RIGHT}"/>{marks}{dots}'
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 6}" text-anchor="middle">{text(across[0])}</text>'
        f'<text x="11" y="{(TOP + HEIGHT - BELOW) / 2}" text-anchor="middle" '
        f'transform="rotate(-90 11 {(TOP + HEIGHT - BELOW) / 2})">{text(up[0])}</text></svg></figure>'
    )


def _rank(trial: Trial, winner: Trial) -> int:
    """Order of drawing; higher ranks are drawn above."""
    if trial.number == winner.number:
        return 3
    return 2 if trial.number == 0 else int(trial.on_front)


def _colour(trial: Trial, winner: Trial) -> str:
    return (PLAIN, FRONT, PRESENT, WINNER)[_rank(trial, winner)]


def _caption(trial: Trial) -> str:
    name = f"trial {trial.number}" if trial.number else "at present"
    values = [f"{key} {value:.4g}" for key, value in trial.values.items()]
    return "; ".join([name, *values, *(f"{key} {value}" for key, value in trial.point.items())])


def _ends(values: Sequence[float]) -> tuple[float, float]:
    low, high = min(values), max(values)
    margin = 0.06 * (high - low) or abs(high) * 0.05 or 1.0
    return low - margin, high + margin


def _ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Round numbers between `low` and `high`, and their text."""
    power = 10.0 ** np.floor(np.log10(high - low))
    step = float(next(part * power for part in (2, 1, 0.5, 0.2) if (high - low) / (part * power) >= LEAST_TICKS))
    decimals = max(0, -int(np.floor(np.log10(step))))
    first, last = int(np.ceil(low / step)), int(np.floor(high / step))
    return [(k * step, number(k * step, decimals)) for k in range(first, last + 1)]

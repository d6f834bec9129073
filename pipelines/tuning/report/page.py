"""The page of a search for parameters: the winner, and how reliable its gain is."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

from footscan.report.markup import breakable, key, number, section, table, text
from footscan.report.page import page
from pipelines.tuning.report.influence import share_of_variance
from pipelines.tuning.report.plots import FRONT, PLAIN, PRESENT, WINNER, by_parameter, course, sound, trade_off
from pipelines.tuning.report.result import Gain, Goal, Trial, TuneResult
from pipelines.tuning.report.stripe_change import COLOURS, change_figures

DECIMALS = {"mm": 4, "%": 2, "s": 2}
"""Decimals of a value, by its unit."""
STATUS = {"real": "ok", "fails less": "ok", "real loss": "incomplete", "fails more": "incomplete"}
"""CSS class of a verdict; any other verdict is uncertain."""
SHOWN = 60
"""Most trials in the table; beyond, only those on the front and the first ones are shown."""


def tune_page(result: TuneResult) -> str:
    """Return a self-contained HTML page; the same result gives the same page."""
    best = result.winner.number
    heading = f"Trial {best} of {len(result.trials) - 1} is best" if best else "The present parameters stay"
    parts = [
        section("Outcome", _tiles(result), *_verdicts(result), _notes(result)),
        section("Parameters", _parameters(result)),
        section("Trials", _key(), _plots(result)),
        section("Influence of each parameter", _INFLUENCE_NOTE, *_influence(result)),
        *_by_set(result),
        section("Where the stripe changes", _CHANGES_NOTE, _changes_key(), change_figures(result.changes))
        if result.changes
        else "",
        section("All trials", _trials(result)),
    ]
    return page(title="footscan tune", kicker="Search for parameters", heading=text(heading), parts=parts)


def sentences(result: TuneResult) -> list[str]:
    """Describe the gain of the winner, a sentence per objective."""
    where = "on the held-out scans" if result.held_out else "on the scans that chose it"
    return [f"{gain.goal.name}, {where}: {_sentence(gain)}" for gain in result.held_out or result.gains]


def _verdicts(result: TuneResult) -> Iterator[str]:
    for gain, line in zip(result.held_out or result.gains, sentences(result), strict=True):
        status = STATUS.get(gain.verdict, "uncertain")
        yield f'<p><span class="status {status}">{text(gain.verdict)}</span> {text(line)}</p>'


def _sentence(gain: Gain) -> str:
    before, after = gain.failed
    sentence = ""
    if before or after:
        sentence = f"the present parameters fail on {before} of {len(gain.sets)} data sets, the winner on {after}. "
        sentence += "On the others: " if gain.both else ""
    if not gain.both:
        return sentence.strip()
    if not gain.mean:
        return f"{sentence}no gain."
    sentence += f"{'gain' if gain.mean > 0 else 'loss'} {_figure(abs(gain.mean), gain.goal)}"
    if gain.spread is None:
        return f"{sentence}; a single data set does not show whether that is real."
    sets = f"better on {gain.improved} of {len(gain.both)} data sets"
    verdict = "real" if abs(gain.mean) > gain.spread else "no larger than the spread, it can be chance"
    return f"{sentence}, {sets}, spread between them {_figure(gain.spread, gain.goal)}: {verdict}."


def _figure(value: float, goal: Goal) -> str:
    return f"{number(value, DECIMALS[goal.unit])} {goal.unit}"


def _tiles(result: TuneResult) -> str:
    tiles = "".join(
        f"<div><span>{text(gain.goal.name)}, present to winner</span>"
        f"<b>{_value(present, gain.goal)} → {_value(winner, gain.goal)}</b> "
        f"{text(gain.goal.unit)}</div>"
        for gain in result.held_out or result.gains
        for present, winner in [gain.means]
    )
    return f'<div class="tiles">{tiles}</div>'


def _notes(result: TuneResult) -> str:
    meanings = [f"{goal.name}: {goal.meaning}." for goal in result.goals]
    return "".join(f'<p class="note">{text(line)}</p>' for line in [*result.notes, *meanings])


def _parameters(result: TuneResult) -> str:
    present, winner = result.trials[0].point, result.winner.point
    rows = ([breakable(name), text(_written(present[name])), text(_written(winner[name]))] for name in present)
    return table(["Parameter", "Present", "Winner"], rows)


def _key() -> str:
    colours = {"present": PRESENT, "winner": WINNER, "on the Pareto front": FRONT, "other trials": PLAIN}
    return key((meaning, _rgb(colour)) for meaning, colour in colours.items())


def _changes_key() -> str:
    return key((meaning, _rgb(colour)) for meaning, colour in COLOURS.items())


def _rgb(colour: str) -> tuple[int, int, int]:
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue


def _plots(result: TuneResult) -> str:
    pairs = list(combinations(result.goals, 2))
    plots = [trade_off(a, b, result.trials, result.winner) for a, b in pairs]
    plots += [course(goal, result.trials, result.winner) for goal in ([] if pairs else result.goals)]
    left_out = len(result.trials) - len(sound(result.trials))
    note = f"<p class='note'>{left_out} trials in which scans failed are not drawn.</p>" if left_out else ""
    return f'<div class="clouds">{"".join(plots)}</div>{note}'


def _influence(result: TuneResult) -> Iterator[str]:
    tried = result.trials[1:]
    names = list(result.winner.point)
    shares = {
        (name, goal.name): share_of_variance(
            [trial.point[name] for trial in tried], [trial.values[goal.name] for trial in tried]
        )
        for name in names
        for goal in result.goals
    }
    rows = (
        [breakable(name), *(_share(shares[name, goal.name]) for goal in result.goals)]
        for name in sorted(names, key=lambda name: -max(shares[name, goal.name] or 0 for goal in result.goals))
    )
    headings = ["Parameter", *(f"{breakable(goal.name)}, %" for goal in result.goals)]
    yield table(headings, rows, numeric=range(1, len(headings)))
    plots = (by_parameter(name, goal, result.trials, result.winner) for name in names for goal in result.goals)
    yield f'<div class="clouds">{"".join(plots)}</div>'


def _share(share: float | None) -> str:
    return "–" if share is None else number(100 * share)


def _by_set(result: TuneResult) -> Iterator[str]:
    for title, gains in (("Held-out data sets", result.held_out), ("Data sets that decided", result.gains)):
        if gains:
            yield section(title, *(_gain_table(gain) for gain in gains))


def _gain_table(gain: Gain) -> str:
    sign = 1 if gain.goal.larger_is_better else -1
    rows = [
        [text(name), *(_value(v, gain.goal) for v in (a, b, None if a is None or b is None else sign * (b - a)))]
        for name, (a, b) in gain.sets.items()
    ]
    of = "" if len(gain.both) == len(rows) else " where neither fails" if gain.both else " where it does not fail"
    rows.append([f"Mean{of}", *(_value(v, gain.goal) for v in (*gain.means, gain.mean))])
    unit = text(gain.goal.unit)
    headings = [f"{text(gain.goal.name)}, {unit}", "Present", "Winner", "Better by"]
    return table(headings, rows, numeric=range(1, 4))


def _value(value: float | None, goal: Goal) -> str:
    return "–" if value is None else number(value, DECIMALS[goal.unit])


def _trials(result: TuneResult) -> str:
    names = list(result.winner.point)
    headings = [
        "Trial",
        *(f"{breakable(g.name)}, {text(g.unit)}" for g in result.goals),
        *map(breakable, names),
        "Failed scans",
    ]
    shown = result.trials
    note = ""
    if len(shown) > SHOWN:
        shown = [t for t in shown if t.on_front or t.number < SHOWN or t.number == result.winner.number]
        note = f'<p class="note">{len(shown)} of {len(result.trials)}; the others are in trials.csv.</p>'
    rows = ([*_trial(trial, names, result)] for trial in shown)
    words = [1 + len(result.goals) + k for k, name in enumerate(names) if isinstance(result.winner.point[name], str)]
    numeric = [column for column in range(1, len(headings)) if column not in words]
    return note + table(headings, rows, numeric=numeric, kind="dense") + _failures(result)


def _failures(result: TuneResult) -> str:
    """The reasons why scans failed, each once."""
    reasons: dict[str, str] = {}
    for trial in result.trials:
        for scan, problem in trial.problems.items():
            name = f"Trial {trial.number}" if trial.number else "At present"
            reasons.setdefault(problem, f"{name}, {scan}: {problem}")
    lines = "".join(f'<p class="note">{text(line)}</p>' for line in reasons.values())
    return f"<details><summary>Why scans failed</summary>{lines}</details>" if lines else ""


def _trial(trial: Trial, names: Sequence[str], result: TuneResult) -> Iterator[str]:
    is_winner = trial.number == result.winner.number
    mark = ' <span class="status ok">winner</span>' if is_winner else " front" if trial.on_front else ""
    yield (str(trial.number) if trial.number else "present") + mark
    for goal in result.goals:
        yield _value(None if trial.problems else trial.values[goal.name], goal)
    for name in names:
        yield text(_written(trial.point[name]))
    yield str(len(trial.problems) or "")


def _written(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


_INFLUENCE_NOTE = (
    '<p class="note">Share of the variance of an objective over the trials that the parameter alone explains, by ranks '
    "and corrected for chance; a dash if there are too few trials. A sampler that seeks the best does not try all "
    "values equally often, so this is a guide and no measurement.</p>"
)
_CHANGES_NOTE = (
    '<p class="note">Frames of the first scans in which the kept points differ most, at most eight; points of the '
    "winner lie over those of the present parameters.</p>"
)

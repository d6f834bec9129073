"""A night: all data sets of a suite are run, and their figures compared with the accepted ones."""

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Literal

from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.pool import OnStepEnd
from pipelines.regression.baseline import (
    read_baseline,
    read_good_steps,
    read_steps,
    write_baseline,
    write_good_steps,
)
from pipelines.regression.figures.costs import cost_figures, keeps_most
from pipelines.regression.figures.timed import take_times
from pipelines.regression.figures.verdict import judge_figures
from pipelines.regression.first_step import EarlierSteps, costly_steps, first_steps
from pipelines.regression.history import History, alone, append, gaps, night_name, read_history
from pipelines.regression.pictures import difference_pictures
from pipelines.regression.report.page import regress_page
from pipelines.regression.report.result import Accepted, JudgedSet, NightResult, Verdict
from pipelines.regression.run_set import SetRun, run_set
from pipelines.regression.sets import parameters_of, prepare, workspace_of
from pipelines.version import SOFTWARE
from schemas.base.errors import Fault, FootscanError, RefusedInput
from schemas.base.yaml_files import read_yaml
from schemas.regression import (
    WORLDS,
    Acceptance,
    AcceptedStep,
    Baseline,
    NightBegun,
    NightEnded,
    Suite,
    SuiteWorlds,
)

PAGE = "index.html"
SHOWN_NIGHTS = 120
"""Most nights on the page, for its size."""
SHOWN_NOTES = 5
"""Most notes of one kind on the page; chosen by hand."""
TIMED_AGAIN = 2
"""How often a scan is timed again whose time or memory is worse, or is to be accepted; chosen by hand.

Other programs that disturbed the first timing do not disturb all of them."""
BAD: tuple[Verdict, ...] = ("worse", "missing")

Status = Literal[0, 1, 3]
OnSet = Callable[[JudgedSet], None]
OnWorld = Callable[[int, int], None]
"""Takes the number of worlds that are done, and of all."""


@dataclass(frozen=True)
class Regression:
    """A suite, and where its files lie."""

    path: Path
    suite: Suite
    out: Path
    baseline: Path

    @property
    def name(self) -> str:
        """Name of the suite: that of its file, or of its folder if the file is suite.yaml."""
        return self.path.stem if self.path.stem != "suite" else self.path.resolve().parent.name


@dataclass(frozen=True)
class Night:
    """The outcome of a night."""

    result: NightResult
    status: Status
    """0 if all is the same or better; 1 if a figure, a set or the baseline is worse or missing; 3 after a fault."""
    page: Path


@dataclass
class _Gathered:
    """Results of the sets that have been run so far."""

    figures: dict[str, dict[str, float | None]] = field(default_factory=dict)
    steps: dict[str, list[AcceptedStep]] = field(default_factory=dict)
    problems: dict[str, str] = field(default_factory=dict)
    has_fault: bool = False


def read_suite(path: Path, out: Path | None = None) -> Regression:
    """Read a suite; RefusedInput if it breaks its format. `out` replaces the folder that it names."""
    suite = read_yaml(path, Suite)
    for name in suite.sets:
        try:
            parameters_of(name, suite)
        except RefusedInput as error:
            raise RefusedInput(path, error.problem, field=f"{error.source}.{error.field}") from None
    base = path.resolve().parent
    folder = (out or base / suite.out).resolve()
    if folder.exists() and not folder.is_dir():
        raise RefusedInput(folder, "is a file, expected a folder for films, cache and history")
    return Regression(path, suite, folder, base / suite.baseline)


def run_night(
    regression: Regression,
    on_step_end: OnStepEnd,
    on_set: OnSet,
    accept: Acceptance | None = None,
    on_world: OnWorld = lambda _done, _total: None,
) -> Night:
    """Run all sets of a suite; with `accept`, make their figures the baseline.

    The history records begin and end of the night, even if sets fail.

    Raises
    ------
    RefusedInput
        The baseline breaks its format, or a set did not run to its end although `accept` is given.
    Fault
        Another night is running, or the disk refuses.
    """
    suite, out = regression.suite, regression.out
    baseline, accepted_steps = read_baseline(regression.baseline), read_steps(regression.baseline)
    with alone(out):
        history = read_history(out)
        name = night_name()
        append(out, NightBegun(night=name, time=_now(), software=SOFTWARE, host=platform.node()))
        gathered = _Gathered()
        judged: list[JudgedSet] = []
        with workspace_of(out).lease():
            good = read_good_steps(out)
            for data_set in suite.sets:
                earlier = EarlierSteps(accepted_steps.sets.get(data_set, []), good.get(data_set, []))
                accepted = {} if baseline is None else baseline.sets.get(data_set, {})
                judged_set = _judge_set(
                    data_set, regression, accepted, earlier, history, gathered, on_step_end,
                    is_accepted=accept is not None,
                )  # fmt: skip
                on_set(judged_set)
                judged.append(judged_set)
            if suite.worlds is not None:
                accepted = {} if baseline is None else baseline.sets.get(WORLDS, {})
                judged.append(_judge_worlds(suite.worlds, regression, accepted, history, gathered, on_world))
                on_set(judged[-1])
        judged += _gone(suite, baseline, history)
        accepted_now = None if gathered.problems else accept
        if accepted_now is not None:
            baseline = write_baseline(regression.baseline, accepted_now, gathered.figures, gathered.steps)
        if baseline is not None:
            good_names = {s.name for s in judged if accepted_now or not (s.problem or s.count(*BAD))}
            write_good_steps(
                out, {**good, **{name: steps for name, steps in gathered.steps.items() if name in good_names}}
            )
        status = _status(judged, gathered, is_accepted=accept is not None, has_baseline=baseline is not None)
        ended = NightEnded(
            night=name,
            time=_now(),
            status=status,
            accepted=None if accepted_now is None else accepted_now.reason,
            worse=[f"{s.name}: {figure.name}" for s in judged for figure in s.figures if figure.verdict in BAD],
            problems=gathered.problems,
            sets=gathered.figures,
        )
        append(out, ended)
        result = _result(regression, judged, baseline, history, ended)
        page = out / PAGE
        write_atomically(page, regress_page(result).encode())
    if accept is not None and gathered.problems:
        failed, problem = next(iter(gathered.problems.items()))
        raise RefusedInput("--accept", f"expected all sets to run to their end, {failed} did not: {problem}")
    return Night(result, status, page)


def _judge_set(
    name: str,
    regression: Regression,
    accepted: Mapping[str, float | None],
    earlier: EarlierSteps,
    history: History,
    gathered: _Gathered,
    on_step_end: OnStepEnd,
    *,
    is_accepted: bool,
) -> JudgedSet:
    """Run and judge one set; its failure does not stop the other sets."""
    suite, nights = regression.suite, history.ended[-SHOWN_NIGHTS + 1 :]
    try:
        prepared = prepare(name, suite, regression.path.resolve().parent, regression.out, on_step_end)
        run = run_set(prepared, suite.timed_passes, on_step_end)
    except FootscanError as error:
        gathered.has_fault |= isinstance(error, Fault)
        run = SetRun(problem=str(error))
    gathered.has_fault |= run.is_fault
    if run.problem is not None:
        gathered.problems[name] = run.problem

    def judge(run: SetRun) -> JudgedSet:
        return JudgedSet(name, run.problem, judge_figures(name, run.figures, accepted, run.truths, suite, nights))

    judged = judge(run)
    for _ in range(TIMED_AGAIN if run.timed else 0):
        costly = [f for f in judged.figures if f.verdict == "worse" and f.name.startswith(("time.", "memory."))]
        if run.job is None or not (costly or is_accepted):
            break
        timed = [*run.timed, take_times(run.job, suite.timed_passes)]
        run = replace(run, timed=timed, figures={**run.figures, **cost_figures(timed)})
        judged = judge(run)
    gathered.figures[name] = dict(run.figures)
    gathered.steps[name] = [step.accepted for step in run.steps]
    if run.store is None:
        return judged
    first = first_steps(earlier, run.steps, run.store)
    if not first and judged.count(*BAD):
        first = first_steps(EarlierSteps(earlier.accepted), run.steps, run.store)
    first += costly_steps(judged.figures, keeps_most(run.timed), earlier, run.steps, run.store)
    results = {step.name: step.result for step in run.steps}
    changed_steps = sum(results.get(step.step) != step.result for step in earlier.accepted)
    pictures, note = difference_pictures(earlier, results, run.store)
    return replace(judged, first=first, changed_steps=changed_steps, pictures=pictures, note=note)


def _judge_worlds(
    worlds: SuiteWorlds,
    regression: Regression,
    accepted: Mapping[str, float | None],
    history: History,
    gathered: _Gathered,
    on_world: OnWorld,
) -> JudgedSet:
    """Run the worlds of a suite and judge their sums."""
    from pipelines.worlds.night import run_night_of_worlds  # late: a suite without worlds needs no virtual scanner

    suite, problem = regression.suite, None
    figures: dict[str, float | None] = {}
    try:
        today = _now().date()
        figures = run_night_of_worlds(
            worlds, suite.parameters, regression.path.resolve().parent, regression.out, today, regression.name, on_world
        ).figures
    except FootscanError as error:
        gathered.has_fault |= isinstance(error, Fault)
        problem = gathered.problems[WORLDS] = str(error)
    gathered.figures[WORLDS], gathered.steps[WORLDS] = figures, []
    nights = history.ended[-SHOWN_NIGHTS + 1 :]
    return JudgedSet(WORLDS, problem, judge_figures(WORLDS, figures, accepted, {}, suite, nights))


def _gone(suite: Suite, baseline: Baseline | None, history: History) -> list[JudgedSet]:
    """Sets of the baseline that the suite no longer has: all of their figures are missing."""
    sets = {} if baseline is None else baseline.sets
    return [
        JudgedSet(
            name,
            "is no longer in the suite",
            judge_figures(name, {}, figures, {}, suite, history.ended[-SHOWN_NIGHTS + 1 :]),
        )
        for name, figures in sets.items()
        if name not in suite.sets and not (name == WORLDS and suite.worlds is not None)
    ]


def _status(judged: Sequence[JudgedSet], gathered: _Gathered, *, is_accepted: bool, has_baseline: bool) -> Status:
    if gathered.has_fault:
        return 3
    if gathered.problems:
        return 1
    return 0 if is_accepted or (has_baseline and not any(judged_set.count(*BAD) for judged_set in judged)) else 1


def _result(
    regression: Regression, judged: Sequence[JudgedSet], baseline: Baseline | None, history: History, ended: NightEnded
) -> NightResult:
    nights = [*history.ended, ended][-SHOWN_NIGHTS:]
    return NightResult(
        suite=regression.name,
        time=ended.time,
        software=SOFTWARE,
        sets=judged,
        accepted=[
            Accepted(entry.reason, entry.date, entry.by, entry.software)
            for entry in (baseline.accepted if baseline else [])
        ],
        nights=[night.time for night in nights],
        notes=_notes(regression.suite, history, ended),
        host=platform.node(),
    )


def _notes(suite: Suite, history: History, ended: NightEnded) -> list[str]:
    notes = [
        f"The night of {_minute(night.time)} began and did not end." for night in history.unfinished[-SHOWN_NOTES:]
    ]
    if suite.every_hours is not None:
        recent = replace(history, ended=[*history.ended[-SHOWN_NIGHTS:], ended])
        notes += [
            f"No night between {_minute(before)} and {_minute(after)}, expected one every {suite.every_hours:g} h."
            for before, after in gaps(recent, timedelta(hours=suite.every_hours))[-SHOWN_NOTES:]
        ]
    if history.damaged:
        lines = ", ".join(map(str, history.damaged[-SHOWN_NOTES:]))
        notes.append(f"Damaged lines of the history were left out: {lines}.")
    return notes


def _minute(time: datetime) -> str:
    return f"{time:%Y-%m-%d %H:%M} UTC"


def _now() -> datetime:
    return datetime.now(UTC).replace(microsecond=0)

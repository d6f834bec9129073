"""A night: every data set of a suite is run and its figures held beside the accepted ones."""

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
from pipelines.regression.first_step import KnownSteps, costly_steps, first_steps
from pipelines.regression.history import History, alone, append, gaps, night_name, read_history
from pipelines.regression.pictures import difference_pictures
from pipelines.regression.report.page import regress_page
from pipelines.regression.report.result import Accepted, JudgedSet, NightResult, Verdict
from pipelines.regression.run_set import SetRun, run_set
from pipelines.regression.sets import parameters_of, prepare, workspace_of
from pipelines.version import SOFTWARE
from schemas.base.errors import Fault, FootscanError, RefusedInput
from schemas.base.yaml_files import read_yaml
from schemas.regression import Acceptance, AcceptedStep, Baseline, NightBegun, NightEnded, Suite

PAGE = "index.html"
SHOWN_NIGHTS = 120
TIMED_AGAIN = 2
"""So often a scan is timed anew whose time or memory is worse, or is to be accepted: what else ran at that time does
not run each time."""
BAD: tuple[Verdict, ...] = ("worse", "missing")

Status = Literal[0, 1, 3]
OnSet = Callable[[JudgedSet], None]


@dataclass(frozen=True)
class Regression:
    """A suite, and where its files lie."""

    path: Path
    suite: Suite
    out: Path
    baseline: Path

    @property
    def name(self) -> str:
        """What the suite is called: its file, or the folder of one that is called suite.yaml."""
        return self.path.stem if self.path.stem != "suite" else self.path.resolve().parent.name


@dataclass(frozen=True)
class Night:
    """What a night came to."""

    result: NightResult
    status: Status
    """0 where all is the same or better, 1 where something is worse or missing, if only the baseline, 3 where a set
    failed by a fault."""
    page: Path


@dataclass
class _Run:
    """What is gathered while a night lasts."""

    figures: dict[str, dict[str, float | None]] = field(default_factory=dict)
    steps: dict[str, list[AcceptedStep]] = field(default_factory=dict)
    problems: dict[str, str] = field(default_factory=dict)
    has_fault: bool = False


def read_suite(path: Path, out: Path | None = None) -> Regression:
    """The suite in a file; RefusedInput where it breaks its format. `out` wins over the one that it names."""
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


def run_night(regression: Regression, on_step_end: OnStepEnd, on_set: OnSet, accept: Acceptance | None = None) -> Night:
    """Run all sets of a suite; with `accept`, make what comes out the baseline.

    The night's begin and end stand in the history, whatever comes between.

    Raises
    ------
    RefusedInput
        The baseline breaks its format, or something was to be accepted that did not run to its end.
    Fault
        Another night is under way, or the disk refuses.
    """
    suite, out = regression.suite, regression.out
    baseline, was = read_baseline(regression.baseline), read_steps(regression.baseline)
    with alone(out):
        history = read_history(out)
        name = night_name()
        append(out, NightBegun(night=name, time=_now(), software=SOFTWARE, host=platform.node()))
        gathered = _Run()
        judged: list[JudgedSet] = []
        with workspace_of(out).lease():
            good = read_good_steps(out)
            for data_set in suite.sets:
                known = KnownSteps(was.sets.get(data_set, []), good.get(data_set, []))
                accepted = {} if baseline is None else baseline.sets.get(data_set, {})
                one = _judge_set(
                    data_set, regression, accepted, known, history, gathered, on_step_end,
                    is_accepted=accept is not None,
                )  # fmt: skip
                on_set(one)
                judged.append(one)
        judged += _gone(suite, baseline, history)
        accepted_now = None if gathered.problems else accept
        if accepted_now is not None:
            baseline = write_baseline(regression.baseline, accepted_now, gathered.figures, gathered.steps)
        if baseline is not None:
            better = {one.name for one in judged if accepted_now or not (one.problem or one.count(*BAD))}
            write_good_steps(out, {**good, **{name: of for name, of in gathered.steps.items() if name in better}})
        status = _status(judged, gathered, is_accepted=accept is not None, has_baseline=baseline is not None)
        ended = NightEnded(
            night=name,
            time=_now(),
            status=status,
            accepted=None if accepted_now is None else accepted_now.reason,
            worse=[f"{one.name}: {figure.name}" for one in judged for figure in one.figures if figure.verdict in BAD],
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
    known: KnownSteps,
    history: History,
    gathered: _Run,
    on_step_end: OnStepEnd,
    *,
    is_accepted: bool,
) -> JudgedSet:
    """Run one set; what goes wrong with it does not cost the others."""
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

    def judged(one: SetRun) -> JudgedSet:
        figures = judge_figures(name, one.figures, accepted, one.known, suite, nights)
        return JudgedSet(name, one.problem, figures)

    found = judged(run)
    for _ in range(TIMED_AGAIN if run.timed else 0):
        costly = [f for f in found.figures if f.verdict == "worse" and f.name.startswith(("time.", "memory."))]
        if run.job is None or not (costly or is_accepted):
            break
        again = [*run.timed, take_times(run.job, suite.timed_passes)]
        run = replace(run, timed=again, figures={**run.figures, **cost_figures(again)})
        found = judged(run)
    gathered.figures[name] = dict(run.figures)
    gathered.steps[name] = [step.accepted for step in run.steps]
    if run.store is None:
        return found
    first = first_steps(known, run.steps, run.store)
    if not first and found.count(*BAD):
        first = first_steps(KnownSteps(known.accepted), run.steps, run.store)
    first += costly_steps(found.figures, keeps_most(run.timed), known, run.steps, run.store)
    results = {step.name: step.result for step in run.steps}
    otherwise = sum(results.get(step.step) != step.result for step in known.accepted)
    pictures, note = difference_pictures(known, results, run.store)
    return replace(found, first=first, otherwise=otherwise, pictures=pictures, note=note)


def _gone(suite: Suite, baseline: Baseline | None, history: History) -> list[JudgedSet]:
    """Sets that the baseline has and the suite has no more: each of their figures is missing."""
    sets = {} if baseline is None else baseline.sets
    return [
        JudgedSet(
            name,
            "is no more in the suite",
            judge_figures(name, {}, figures, {}, suite, history.ended[-SHOWN_NIGHTS + 1 :]),
        )
        for name, figures in sets.items()
        if name not in suite.sets
    ]


def _status(judged: Sequence[JudgedSet], gathered: _Run, *, is_accepted: bool, has_baseline: bool) -> Status:
    if gathered.has_fault:
        return 3
    if gathered.problems:
        return 1
    return 0 if is_accepted or (has_baseline and not any(one.count(*BAD) for one in judged)) else 1


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
            Accepted(one.reason, one.date, one.by, one.software) for one in (baseline.accepted if baseline else [])
        ],
        nights=[night.time for night in nights],
        notes=_notes(regression.suite, history, ended),
        host=platform.node(),
    )


def _notes(suite: Suite, history: History, ended: NightEnded) -> list[str]:
    notes = [f"The night of {_minute(night.time)} began and did not end." for night in history.unfinished[-5:]]
    if suite.every_hours is not None:
        known = replace(history, ended=[*history.ended[-SHOWN_NIGHTS:], ended])
        notes += [
            f"No night between {_minute(one)} and {_minute(other)}, expected one every {suite.every_hours:g} h."
            for one, other in gaps(known, timedelta(hours=suite.every_hours))[-5:]
        ]
    if history.damaged:
        lines = ", ".join(map(str, history.damaged[-5:]))
        notes.append(f"Damaged lines of the history were left out: {lines}.")
    return notes


def _minute(time: datetime) -> str:
    return f"{time:%Y-%m-%d %H:%M} UTC"


def _now() -> datetime:
    return datetime.now(UTC).replace(microsecond=0)

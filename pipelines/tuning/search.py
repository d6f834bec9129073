"""A search for better parameters, from its description in a workflow to its result."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from footscan.recordings.scans import RecordedScan
from pipelines.archive.job import Job
from pipelines.archive.planning import PlannedJob, plan_job
from pipelines.archive.running import share_written
from pipelines.engine.pool import OnStepEnd, Pool
from pipelines.engine.store.permissions import warn_if_others_can_write
from pipelines.tuning.bench import Bench
from pipelines.tuning.changes import frame_changes
from pipelines.tuning.clock import Clock
from pipelines.tuning.data import may_be_meant, split
from pipelines.tuning.journal import Journal
from pipelines.tuning.objectives import FLOORS, Judged, goals_of, mean_of, values_of
from pipelines.tuning.pareto_front import best_compromise, on_front
from pipelines.tuning.report.result import Gain, Goal, Trial, TuneResult
from pipelines.tuning.sampling import proposals_of
from pipelines.tuning.space import Point, present_point, with_point
from schemas.base.errors import RefusedInput
from schemas.base.model import canonical_json
from schemas.parameters.scan import ScanParameters
from schemas.tuning import TriedPoint, Tuning

FOLDER = "tune"
"""Name of the folder within that of the results."""
ASKED_AGAIN = 20
"""Bound of the proposals per trial, on average, since a sampler may propose points that were tried; chosen by hand."""

OnTrial = Callable[[Trial], None]


@dataclass(frozen=True)
class Tuned:
    """The outcome of a search, and its cost."""

    result: TuneResult
    parameters: ScanParameters
    """Parameters of the winner."""
    refused: Mapping[str, str]
    """Scans that were left out, and why."""
    faults: int
    """Number of scans that failed in a trial by a fault of the machine."""
    ran: Mapping[str, int]
    """Number of steps that ran, by kind."""


def tune(job: Job, tuning: Tuning, pool: Pool, on_step_end: OnStepEnd, on_trial: OnTrial) -> Tuned:
    """Try sets of parameters on the scans of a job, and test the best on the scans that are held out.

    Each trial plans the steps of all scans with other parameters. Results of steps from earlier searches and from
    `footscan run` are reused. Nothing is delivered into the results.

    Raises
    ------
    RefusedInput
        The search does not fit the scans.
    Fault
        All scans of a trial failed by a fault of the machine; the next search continues from there.
    """
    planned = plan_job(replace(job, folders=[folder for folder in job.folders if may_be_meant(folder, job, tuning)]))
    share_written(planned)
    warn_if_others_can_write(planned.workspace.store, planned.job.group)
    with planned.workspace:
        return _tune(planned, tuning, pool, on_step_end, on_trial)


def _tune(planned: PlannedJob, tuning: Tuning, pool: Pool, on_step_end: OnStepEnd, on_trial: OnTrial) -> Tuned:
    if not planned.scans and planned.refused:
        raise planned.refused[0].error
    data, held_out = split([entry.scan for entry in planned.scans], tuning)
    goals, notes = goals_of(tuning.objectives, data)
    journal = Journal(planned.job.results / FOLDER, tuning)
    earlier = [tried.point for tried in journal.read() if tried.point is not None]
    clock = Clock(journal.seconds())
    bench = Bench(planned, pool, on_step_end, frozenset(goal.name for goal in goals), clock)
    search = _Search(bench, tuning, goals, data, planned.job.parameters, journal)
    with planned.workspace.lease():
        search.run(earlier, on_trial)
        result, parameters = search.result(held_out, notes)
    refused = {entry.scan: str(entry.error) for entry in planned.refused}
    return Tuned(result, parameters, refused, search.faults, dict(clock.ran))


class _Search:
    """The trials of a search."""

    def __init__(
        self,
        bench: Bench,
        tuning: Tuning,
        goals: Sequence[Goal],
        data: Sequence[RecordedScan],
        present: ScanParameters,
        journal: Journal,
    ) -> None:
        self._bench, self._tuning, self._goals, self._data = bench, tuning, goals, data
        self._present, self._journal = present, journal
        self._judged: list[dict[str, Judged]] = []
        self._trials: list[Trial] = []
        self.faults = 0

    def run(self, earlier: Sequence[Point], on_trial: OnTrial) -> None:
        """Try the present parameters, then one proposal after another; `earlier` points replace the first proposals."""
        proposals = proposals_of(self._tuning, len(self._goals))
        on_trial(self._try(None))
        is_grid = self._tuning.sampler == "grid"
        tried: dict[str, Trial] = {}
        asked = 0
        while is_grid or (len(tried) < self._tuning.trials and asked < ASKED_AGAIN * self._tuning.trials):
            point = proposals.ask()
            if point is None:
                break
            if is_known := asked < len(earlier):
                point = earlier[asked]
            name = canonical_json(point)
            if name not in tried:
                tried[name] = self._try(point, is_known=is_known)
                on_trial(tried[name])
            elif not is_known:
                self._journal.append(TriedPoint(point=point, seconds={}))
            proposals.tell(point, [_badness(goal, tried[name].values[goal.name]) for goal in self._goals])
            asked += 1

    def result(self, held_out: Sequence[RecordedScan], notes: Sequence[str]) -> tuple[TuneResult, ScanParameters]:
        """Choose the winner, and compare it with the present parameters."""
        values = [[_badness(goal, trial.values[goal.name]) for goal in self._goals] for trial in self._trials]
        front = on_front(values)
        trials = [replace(trial, on_front=number in front) for number, trial in enumerate(self._trials)]
        best = best_compromise(values, [FLOORS[goal.unit] for goal in self._goals], front)
        parameters = self._present if best == 0 else with_point(self._present, trials[best].point)
        on_data = self._judged[0], self._judged[best]
        if held_out:
            tested = self._judge(self._present, held_out), self._judge(parameters, held_out)
        all_notes = [*notes]
        if not held_out:
            all_notes.append("No scan was held out: the gain is too large, since the same scans chose the winner.")
        tests = self._gains(*tested, held_out) if held_out else []
        untested = [goal.name for goal in self._goals if goal not in [gain.goal for gain in tests]]
        if held_out and untested:
            all_notes.append(f"The held-out scans do not test {', '.join(untested)}.")
        if failed := sum(bool(trial.problems) for trial in trials):
            all_notes.append(f"In {failed} of {len(trials)} trials scans failed; each counts as the worst value.")
        result = TuneResult(
            goals=self._goals,
            sampler=self._tuning.sampler,
            notes=all_notes,
            trials=trials,
            winner=trials[best],
            gains=self._gains(*on_data, self._data),
            held_out=tests,
            changes=frame_changes(self._bench, self._present, parameters, [*held_out, *self._data]) if best else [],
        )
        return result, parameters

    def _try(self, point: Point | None, *, is_known: bool = False) -> Trial:
        """Judge a set of parameters; None stands for the present ones."""
        try:
            parameters = self._present if point is None else with_point(self._present, point)
        except RefusedInput as error:
            judged = {scan.name: Judged(problem=str(error), kind="refused") for scan in self._data}
            if not is_known:
                self._journal.append(TriedPoint(point=point, seconds={}))
        else:
            judged = self._judge(parameters, self._data, None if is_known else point)
        of_sets = {goal.name: values_of(goal, judged, self._data) for goal in self._goals}
        problems = {name: scan.problem for name, scan in judged.items() if scan.problem is not None}
        for goal in self._goals:
            unknown = (name for name, value in of_sets[goal.name].items() if value is None)
            problems = {name: f"{goal.name} is unknown" for name in unknown if name in judged} | problems
        trial = Trial(
            number=len(self._trials),
            point=present_point(self._present, self._tuning) if point is None else point,
            values={goal.name: mean_of(goal, of_sets[goal.name]) for goal in self._goals},
            of_sets=of_sets,
            problems=problems,
        )
        self._trials.append(trial)
        self._judged.append(judged)
        return trial

    def _judge(
        self, parameters: ScanParameters, scans: Sequence[RecordedScan], new: Point | None = None
    ) -> dict[str, Judged]:
        """Judge parameters; `new` is their point if the journal does not have it yet."""
        judged, seconds = self._bench.judge(parameters, scans)
        if seconds or new is not None:
            self._journal.append(TriedPoint(point=new, seconds=seconds))
        self.faults += sum(scan.kind == "fault" for scan in judged.values())
        return judged

    def _gains(
        self, present: Mapping[str, Judged], winner: Mapping[str, Judged], scans: Sequence[RecordedScan]
    ) -> list[Gain]:
        gains = []
        for goal in self._goals:
            before, after = (values_of(goal, judged, scans) for judged in (present, winner))
            if before:
                gains.append(Gain(goal, {name: (before[name], after[name]) for name in before}))
        return gains


def _badness(goal: Goal, value: float) -> float:
    """An objective as a value that is better the nearer it is to 0; for completeness that is the missing share, %."""
    return 100 - value if goal.larger_is_better else value

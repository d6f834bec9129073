"""A search for better parameters, from the workflow that describes it to what it came to."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from footscan.recordings.scans import RecordedScan
from pipelines.archive.job import Job, PlannedJob, plan_job, share_written
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
"""In the folder of the results."""
ASKED_AGAIN = 20
"""A sampler that proposes what was tried already is asked again, so often for each trial on average."""

OnTrial = Callable[[Trial], None]


@dataclass(frozen=True)
class Tuned:
    """What a search came to, and what it took."""

    result: TuneResult
    parameters: ScanParameters
    """The winner's."""
    refused: Mapping[str, str]
    """Scans that took no part, and why."""
    faults: int
    """Scans that failed, in some trial, by a fault of the machine."""
    ran: Mapping[str, int]
    """Steps that ran, by kind."""


def tune(job: Job, tuning: Tuning, pool: Pool, on_step_end: OnStepEnd, on_trial: OnTrial) -> Tuned:
    """Try sets of parameters on the scans of a job, and test the best on those held out.

    Every trial is the plan of all scans' steps with other parameters: what was run before, in this search, in another
    or by `footscan run`, is known. Nothing is delivered into the results.

    Raises
    ------
    RefusedInput
        The search does not fit the scans.
    Fault
        All scans of a trial failed by a fault of the machine; the next search goes on from there.
    """
    planned = plan_job(replace(job, folders=[folder for folder in job.folders if may_be_meant(folder, job, tuning)]))
    share_written(planned)
    warn_if_others_can_write(planned.workspace.store, planned.job.group)
    with planned.workspace:
        return _tune(planned, tuning, pool, on_step_end, on_trial)


def _tune(planned: PlannedJob, tuning: Tuning, pool: Pool, on_step_end: OnStepEnd, on_trial: OnTrial) -> Tuned:
    if not planned.scans and planned.refused:
        raise planned.refused[0].error
    data, held_out = split([one.scan for one in planned.scans], tuning)
    goals, notes = goals_of(tuning.objectives, data)
    journal = Journal(planned.job.results / FOLDER, tuning)
    known = [one.point for one in journal.read() if one.point is not None]
    clock = Clock(journal.seconds())
    bench = Bench(planned, pool, on_step_end, frozenset(goal.name for goal in goals), clock)
    search = _Search(bench, tuning, goals, data, planned.job.parameters, journal)
    with planned.workspace.lease():
        search.run(known, on_trial)
        result, parameters = search.result(held_out, notes)
    refused = {one.scan: str(one.error) for one in planned.refused}
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

    def run(self, known: Sequence[Point], on_trial: OnTrial) -> None:
        """Try the present parameters, then one proposal after another; `known` are those of an earlier run."""
        proposals = proposals_of(self._tuning, len(self._goals))
        on_trial(self._try(None))
        is_grid = self._tuning.sampler == "grid"
        tried: dict[str, Trial] = {}
        asked = 0
        while is_grid or (len(tried) < self._tuning.trials and asked < ASKED_AGAIN * self._tuning.trials):
            point = proposals.ask()
            if point is None:
                break
            if is_known := asked < len(known):
                point = known[asked]
            name = canonical_json(point)
            if name not in tried:
                tried[name] = self._try(point, is_known=is_known)
                on_trial(tried[name])
            elif not is_known:
                self._journal.append(TriedPoint(point=point, seconds={}))
            proposals.tell(point, [_badness(goal, tried[name].values[goal.name]) for goal in self._goals])
            asked += 1

    def result(self, held_out: Sequence[RecordedScan], notes: Sequence[str]) -> tuple[TuneResult, ScanParameters]:
        """The winner, beside the present parameters."""
        values = [[_badness(goal, trial.values[goal.name]) for goal in self._goals] for trial in self._trials]
        front = on_front(values)
        trials = [replace(trial, on_front=number in front) for number, trial in enumerate(self._trials)]
        best = best_compromise(values, [FLOORS[goal.unit] for goal in self._goals], front)
        parameters = self._present if best == 0 else with_point(self._present, trials[best].point)
        on_data = self._judged[0], self._judged[best]
        if held_out:
            tested = self._judge(self._present, held_out), self._judge(parameters, held_out)
        told = [*notes]
        if not held_out:
            told.append("No scan was held out: the gain is that on the scans that chose the winner, and so too large.")
        tests = self._gains(*tested, held_out) if held_out else []
        untold = [goal.name for goal in self._goals if goal not in [gain.goal for gain in tests]]
        if held_out and untold:
            told.append(f"The held-out scans do not tell {', '.join(untold)}.")
        if failed := sum(bool(trial.problems) for trial in trials):
            told.append(f"In {failed} of {len(trials)} trials scans failed; each counts as the worst that there is.")
        result = TuneResult(
            goals=self._goals,
            sampler=self._tuning.sampler,
            notes=told,
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
        problems = {name: one.problem for name, one in judged.items() if one.problem is not None}
        for goal in self._goals:
            unknown = (name for name, value in of_sets[goal.name].items() if value is None)
            problems = {name: f"{goal.name} is not known" for name in unknown if name in judged} | problems
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
        """Judge parameters; `new` is their point where the journal does not have it yet."""
        judged, seconds = self._bench.judge(parameters, scans)
        if seconds or new is not None:
            self._journal.append(TriedPoint(point=new, seconds=seconds))
        self.faults += sum(one.kind == "fault" for one in judged.values())
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
    """An objective as a quantity that is better the nearer it is to 0: of completeness, what is missing."""
    return 100 - value if goal.larger_is_better else value

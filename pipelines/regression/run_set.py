"""Run a data set with the cache of the suite, and with an empty cache to take its times."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from footscan.recordings.scans import read_scan
from pipelines.archive.job import Job
from pipelines.archive.planning import PlannedJob, draw_steps, plan_job
from pipelines.archive.running import ScanEnd, run_job
from pipelines.engine.actions.step import Outcome, Step, Success
from pipelines.engine.pool import OnStepEnd, Threads
from pipelines.engine.store.store import Store
from pipelines.regression.figures.costs import cost_figures, unsteady
from pipelines.regression.figures.delivered import MADE_OF, delivered_figures
from pipelines.regression.figures.of_scan import result_figures
from pipelines.regression.figures.timed import Pass, take_times
from pipelines.regression.first_step import PresentStep, present_steps
from pipelines.regression.sets import PreparedSet


@dataclass(frozen=True)
class SetRun:
    """The outcome of a data set."""

    problem: str | None = None
    """Why it was not run to its end."""
    is_fault: bool = False
    figures: Mapping[str, float | None] = field(default_factory=dict)
    truths: Mapping[str, float] = field(default_factory=dict)
    """True measures of the foot, mm, by name."""
    steps: Sequence[PresentStep] = ()
    timed: Sequence[Sequence[Pass]] = ()
    """Passes of each timed process."""
    job: Job | None = None
    store: Store | None = None


def run_set(prepared: PreparedSet, passes: int, on_step_end: OnStepEnd) -> SetRun:
    """Run a prepared set, then `passes` times with an empty cache.

    Raises
    ------
    Fault
        The timed process died.
    """
    job = prepared.job
    planned = plan_job(job)
    [end] = run_job(planned, Threads(job.threads), on_step_end)
    if planned.refused:
        return SetRun(problem=end.problem, truths=prepared.truths)
    planned_again = plan_job(job)
    steps, outcomes = _outcomes(prepared, planned_again)
    planned_again.workspace.close()
    store = Store(planned_again.workspace.store.files)  # few results are read, each once
    present = present_steps(steps, outcomes)
    figures = _figures(end, steps, outcomes, store)
    figures |= {"steps.all": len(steps), "steps.run_again": planned_again.to_run}
    timed = [take_times(job, passes)] if passes and end.problem is None else []
    if timed:
        results = {step.name: step.result for step in present}
        figures |= {"steps.unsteady": len(unsteady(timed, results)), **cost_figures(timed)}
    is_fault = end.kind in {"fault", "damaged"}
    return SetRun(end.problem, is_fault, figures, prepared.truths, present, timed, job, store)


def _outcomes(prepared: PreparedSet, planned: PlannedJob) -> tuple[list[Step], dict[str, Outcome]]:
    """All steps of a set that has been run, beginning with those that filmed it, and their outcomes."""
    [folder] = prepared.job.folders
    steps = draw_steps(read_scan(folder, prepared.job.archive_of(folder)), planned)
    plan = planned.workspace.plan(steps)
    outcomes = dict(prepared.outcomes) | {p.step.name: p.outcome for p in plan.steps if p.outcome is not None}
    return [*prepared.filming, *steps], outcomes


def _figures(
    end: ScanEnd, steps: Sequence[Step], outcomes: Mapping[str, Outcome], store: Store
) -> dict[str, float | None]:
    """Figures of the documents, shapes and delivered files of a scan, as far as they exist."""
    if end.folder is None:
        return {}
    documents: dict[str, bytes] = {}
    for step in steps:
        outcome = outcomes.get(step.name)
        if step.kind in {"quality", "measure", "texture", *MADE_OF.values()} and isinstance(outcome, Success):
            documents[step.kind] = store.get(outcome.digest) or b""
    if not {"quality", "measure"} <= documents.keys():
        return {}
    shapes = {kind: documents[kind] for kind in MADE_OF.values() if documents.get(kind)}
    return result_figures(documents) | delivered_figures(end.folder, shapes)

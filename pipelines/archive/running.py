"""Running a planned job and delivering its results. A failed scan does not stop the others, unless it shall."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

from footscan.recordings.scans import RecordedScan
from pipelines.archive.early_delivery import LAST, EarlyDelivery, older_results
from pipelines.archive.planning import PlannedJob, PlannedScan, draw_steps
from pipelines.engine.actions.step import Failure, Outcome, Step, Success
from pipelines.engine.files.access import share
from pipelines.engine.pool import OnStepEnd, Pool, StepEnd
from pipelines.engine.store.erasure_notes import interrupted_erasures
from pipelines.engine.store.permissions import warn_if_others_can_write
from pipelines.scan import DELIVERABLE
from schemas.measures import Measures
from schemas.quality import Quality
from schemas.scan import Scan

WINDOW = 8
"""Scans per worker whose steps are submitted at once: a bound of memory, which must not grow with the archive."""

log = logging.getLogger("footscan.archive")


@dataclass(frozen=True)
class ScanEnd:
    """The end of one scan of a job."""

    scan: str
    source: Path
    """Folder of the scan."""
    folder: Path | None
    """Folder of its results; None if it has none."""
    problem: str | None
    kind: str | None
    """`refused`, `finding`, `fault` or `damaged`, as in `Failure`."""
    digests: Mapping[str, str] = field(default_factory=dict)
    """Digests of the files in its results, by file name."""
    was_cached: bool = False
    """True if all its steps were hits."""
    document: Scan | None = None
    """Content of its scan.yaml; None if that was refused."""
    parameters_sha256: str | None = None
    """Digest of the parameters of all steps, as canonical JSON; None if unknown."""
    warnings: Sequence[str] = ()
    """All that speaks against its results, as `scan_warnings` of quality.json has it."""
    until: str | None = None
    """The step after which its run ended; None if it was whole."""


class _FirstFailure(Exception):
    """A step has failed, and its run shall end."""

    def __init__(self, scan: str, failure: Failure) -> None:
        super().__init__(failure.problem)
        self.scan, self.failure = scan, failure


def run_job(planned: PlannedJob, pool: Pool, on_step_end: OnStepEnd) -> Iterator[ScanEnd]:
    """Run the steps of a planned job that are not hits, and deliver the results; yields the end of each scan."""
    fail_fast = planned.job.fail_fast
    for name, folder, error in planned.refused:
        earlier = "" if Path(name).is_absolute() else older_results(planned.job.results / name)
        yield ScanEnd(name, folder, None, f"{error}{earlier}", "refused", parameters_sha256=planned.parameters_sha256)
        if fail_fast:
            return
    # What is known to fail comes first where that ends the run.
    waiting = iter(sorted(planned.scans, key=lambda scan: scan.failure is None) if fail_fast else planned.scans)
    share_written(planned)
    warn_if_others_can_write(planned.workspace.store, planned.job.group)
    for name in interrupted_erasures(planned.workspace.store):
        log.warning("%s: its erasure was interrupted, run 'footscan forget' for it again", name)
    # A job that runs no steps needs no lease: it uses only the results that it has looked up.
    held = planned.workspace.lease() if planned.to_run else nullcontext()
    with planned.workspace, held:
        while window := list(islice(waiting, WINDOW * pool.count)):
            for end in _run_window(window, planned, pool, on_step_end):
                yield end
                if fail_fast and end.problem is not None:
                    return


def share_written(planned: PlannedJob) -> None:
    """Give the group of a job, if it has one, access to all files that its run writes."""
    job = planned.job
    frames = [scan.scan.arrays() for scan in planned.scans if scan.to_run]
    share([job.results, *([job.cache] if isinstance(job.cache, Path) else []), *frames], job.group)


def _run_window(
    window: Sequence[PlannedScan], planned: PlannedJob, pool: Pool, on_step_end: OnStepEnd
) -> Iterator[ScanEnd]:
    """Run some scans together; scans without steps to run only have their results delivered."""
    forced, fail_fast = planned.job.selection.force, planned.job.fail_fast
    if fail_fast and window[0].failure is not None:
        yield _end_scan(window[0], {}, planned)
        return
    steps: list[Step] = []
    for scan in window:
        if scan.to_run:
            steps += draw_steps(scan.scan, planned)
    running = [scan for scan in window if scan.to_run and scan.failure is None]
    early = EarlyDelivery(
        planned.workspace,
        {scan.scan.name: _target(scan.scan, planned) for scan in running},
        {scan.scan.name: scan.delivered for scan in running},
    )

    def on_end(end: StepEnd) -> None:
        early.on_step_end(end)
        on_step_end(end)
        if fail_fast and isinstance(end.outcome, Failure) and end.outcome.kind != "damaged":
            raise _FirstFailure(end.step.scan, end.outcome)

    try:
        outcomes = planned.workspace.run(steps, pool, on_end, forced)
    except _FirstFailure as first:
        yield from _ended_before(first, window, planned)
        return
    for scan in window:
        end = _end_scan(scan, outcomes, planned)
        if end.kind == "damaged":
            log.warning("%s", end.problem)
            outcomes_again = planned.workspace.run(draw_steps(scan.scan, planned), pool, on_step_end)
            end = _end_scan(scan, outcomes_again, planned)
        yield end


def _ended_before(first: _FirstFailure, window: Sequence[PlannedScan], planned: PlannedJob) -> Iterator[ScanEnd]:
    """The ends of those scans that were complete at the first failure, then of the scan that has failed."""
    failed = next((scan for scan in window if scan.scan.name == first.scan), window[-1])
    for scan in window:
        plan = planned.workspace.plan(draw_steps(scan.scan, planned))
        outcomes = {one.step.name: one.outcome for one in plan.steps if isinstance(one.outcome, Success)}
        if scan is not failed and len(outcomes) == len(plan.steps):
            yield _end_scan(scan, outcomes, planned)
    yield _end_scan(failed, {f"{failed.scan.name}/": first.failure}, planned)


def _target(scan: RecordedScan, planned: PlannedJob) -> Path:
    """Folder of the results of a scan."""
    return planned.job.results / scan.document.patient / scan.document.scan


def _end_scan(planned_scan: PlannedScan, outcomes: Mapping[str, Outcome], planned: PlannedJob) -> ScanEnd:
    """Deliver the results of a scan, if it has them."""
    scan = planned_scan.scan
    target = _target(scan, planned)
    ended = ScanEnd(
        scan.name, scan.folder, None, None, None, document=scan.document, parameters_sha256=planned.parameters_sha256
    )
    own = [outcome for name, outcome in outcomes.items() if name.rpartition("/")[0] == scan.name]
    failure = planned_scan.failure or next((outcome for outcome in own if isinstance(outcome, Failure)), None)
    if failure is not None:
        return replace(ended, problem=failure.problem + older_results(target), kind=failure.kind)
    made = {file: outcomes.get(f"{scan.name}/{kind}") for file, kind in DELIVERABLE.items()}
    digests = {**planned_scan.delivered, **{f: one.digest for f, one in made.items() if isinstance(one, Success)}}
    until = planned.job.selection.until
    if until is not None and (target / LAST).exists():
        return replace(ended, until=until)  # a part of them must not lie beside earlier ones
    problem = planned.workspace.deliver(digests, target)
    if problem is not None:
        has = planned.workspace.store.has  # damaged blobs have been removed
        is_complete = all(has(digest) for digest in digests.values())
        return replace(ended, problem=problem, kind="fault" if is_complete else "damaged")
    if until is not None:
        return replace(ended, digests=digests, until=until)
    finding = Measures.model_validate_json((target / "measures.json").read_bytes()).finding
    quality = Quality.model_validate_json((target / "quality.json").read_bytes())
    return replace(
        ended,
        folder=target,
        problem=finding,
        kind=None if finding is None else "finding",
        digests=digests,
        was_cached=not planned_scan.to_run,
        warnings=quality.scan_warnings or (),
    )

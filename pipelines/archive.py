"""An archive of scans: planned as a whole, run as a whole; one scan's failure is its own."""

import logging
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pipelines.deliver import deliver
from pipelines.engine.digest import FileDigests, sha256
from pipelines.engine.plan import Plan, make_plan
from pipelines.engine.run import OnStepEnd, run_plan
from pipelines.engine.step import Failure, Outcome, Step
from pipelines.engine.store import Store
from pipelines.recorded import RecordedScan, read_scan, scan_folders
from pipelines.scan import DELIVERED, CalibrationFile, scan_steps
from schemas.calibration import calibration_from_json
from schemas.documents import read_text, read_yaml
from schemas.errors import RefusedInput
from schemas.measures import Measures
from schemas.workflow import ScanParameters, Workflow

CACHE = ".footscan"

log = logging.getLogger("footscan.archive")


@dataclass(frozen=True)
class Job:
    """Which scans, with what, to where."""

    folders: list[Path]
    archive: Path | None
    """Root that the scans' paths may not leave; without it, two levels above each scan."""
    calibration: Path | None
    """Wins over the scans' own where `calibration_wins`, stands in for it otherwise."""
    calibration_wins: bool
    results: Path
    cache: Path
    parameters: ScanParameters
    workers: int


@dataclass
class PlannedJob:
    """What a job has to do."""

    job: Job
    plan: Plan
    digests: FileDigests
    refused: dict[str, RefusedInput] = field(default_factory=dict)
    """Scans whose input breaks its format, by folder or name."""
    scans: list[RecordedScan] = field(default_factory=list)


@dataclass(frozen=True)
class ScanEnd:
    """What became of one scan."""

    scan: str
    folder: Path | None
    """Its results; None where it has none."""
    problem: str | None
    kind: str | None
    """`refused`, `finding`, `fault` or `damaged`, as in `Failure`."""


def job_of_workflow(path: Path, workers: int | None = None) -> Job:
    """The job that a workflow.yaml describes."""
    workflow = read_yaml(path, Workflow)
    base = path.resolve().parent
    archive = base / workflow.archive
    results = base / workflow.results
    folders = list(scan_folders(archive))
    if not folders:
        raise RefusedInput(path, f"expected folders with a scan.yaml below {archive}, found none", field="archive")
    return Job(
        folders=folders,
        archive=archive,
        calibration=base / workflow.calibration if workflow.calibration else None,
        calibration_wins=False,
        results=results,
        cache=base / workflow.cache if workflow.cache else results / CACHE,
        parameters=workflow.parameters,
        workers=workers or workflow.workers or cores(),
    )


def job_of_scan(folder: Path, calibration: Path | None, results: Path, workers: int | None = None) -> Job:
    """The job of one scan without a workflow."""
    if results.exists() and not results.is_dir():
        raise RefusedInput(results, "is a file, expected a folder for the results")
    return Job(
        folders=[folder],
        archive=None,
        calibration=calibration,
        calibration_wins=True,
        results=results,
        cache=results / CACHE,
        parameters=ScanParameters(),
        workers=workers or cores(),
    )


def plan_job(job: Job) -> PlannedJob:
    """Draw the graph of all scans of a job and look every step up in the cache."""
    digests = FileDigests.load(job.cache / "files.json")
    steps: list[Step] = []
    planned = PlannedJob(job, Plan([]), digests)
    calibrations: dict[Path, CalibrationFile] = {}
    names: dict[str, Path] = {}
    for folder in job.folders:
        try:
            scan = read_scan(folder, job.archive)
            if scan.name in names:
                raise RefusedInput(scan.file, f"{scan.name} is also in {names[scan.name]}, expected each scan once")
            names[scan.name] = folder
            calibration = _calibration(scan, job, calibrations)
            steps += scan_steps(scan, calibration, job.parameters, digests)
            planned.scans.append(scan)
        except RefusedInput as error:
            planned.refused[str(folder)] = error
    planned.plan = make_plan(steps, Store(job.cache))
    return planned


def run_job(planned: PlannedJob, on_step_end: OnStepEnd) -> Iterable[ScanEnd]:
    """Run what is left of a planned job and deliver each scan's results; yields what became of each scan."""
    job, store = planned.job, Store(planned.job.cache)
    for folder, error in planned.refused.items():
        yield ScanEnd(folder, None, str(error), "refused")
    outcomes = _run_and_mend(planned.plan, store, job.workers, on_step_end)
    for scan in planned.scans:
        end = _end_scan(scan, outcomes, store, planned)
        if end.kind == "damaged":
            log.warning("%s", end.problem)
            again = make_plan([p.step for p in planned.plan.steps], store)
            outcomes = _run_and_mend(again, store, job.workers, on_step_end)
            end = _end_scan(scan, outcomes, store, planned)
        yield end
    planned.digests.save()


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _run_and_mend(plan: Plan, store: Store, workers: int, on_step_end: OnStepEnd) -> dict[str, Outcome]:
    """Run a plan; what turns out to be damaged has been set aside then, and is made anew by another."""
    outcomes = run_plan(plan, store, workers=workers, on_step_end=on_step_end)
    told: set[str] = set()
    while damage := _damage(outcomes) - told:  # behind what was damaged there may be more
        for problem in sorted(damage):
            log.warning("%s", problem)
        told |= damage
        again = make_plan([p.step for p in plan.steps], store)
        outcomes = run_plan(again, store, workers=workers, on_step_end=on_step_end)
    return outcomes


def _damage(outcomes: Mapping[str, Outcome]) -> set[str]:
    return {end.problem for end in outcomes.values() if isinstance(end, Failure) and end.kind == "damaged"}


def _end_scan(scan: RecordedScan, outcomes: dict[str, Outcome], store: Store, planned: PlannedJob) -> ScanEnd:
    """Deliver a scan's results, if it has them."""
    target = planned.job.results / scan.document.patient / scan.document.scan
    digests: dict[str, str] = {}
    for file, kind in DELIVERED.items():
        outcome = outcomes[f"{scan.name}/{kind}"]
        if isinstance(outcome, Failure):
            return ScanEnd(scan.name, None, outcome.problem + _what_stays(target), outcome.kind)
        digests[file] = outcome.digest
    problem = deliver(digests, store, planned.digests, target)
    if problem is not None:
        whole = all(store.has(digest) for digest in digests.values())  # what is damaged has been set aside
        return ScanEnd(scan.name, None, problem, "fault" if whole else "damaged")
    finding = Measures.model_validate_json((target / "measures.json").read_bytes()).finding
    return ScanEnd(scan.name, target, finding, None if finding is None else "finding")


def _what_stays(target: Path) -> str:
    """A warning where a scan that failed has results, which then are an earlier run's."""
    return f" ({target} still holds the results of an earlier run)" if target.exists() else ""


def _calibration(scan: RecordedScan, job: Job, known: dict[Path, CalibrationFile]) -> CalibrationFile:
    path = job.calibration if job.calibration_wins and job.calibration else scan.calibration or job.calibration
    if path is None:
        raise RefusedInput(
            scan.file,
            "names no calibration, expected one here or in the workflow",
            field="calibration",
        )
    if path not in known:
        text = read_text(path)
        known[path] = CalibrationFile(path, calibration_from_json(text, path), sha256(text.encode()))
    return known[path]

"""Jobs: archives of scans, planned and run as a whole. A failed scan does not stop the others."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from footscan.recordings.calibration_checks import check_of_scan
from footscan.recordings.scans import RecordedScan, read_scan, scan_folders
from pipelines.archive.early_delivery import EarlyDelivery, older_results
from pipelines.archive.workflow_file import check_archives, read_workflow
from pipelines.calibrate import CaptureInputs, CaptureOfScan, recorded_inputs
from pipelines.engine.actions.key import parameters_text
from pipelines.engine.actions.step import Failure, Outcome, Step, Success
from pipelines.engine.files.access import group_number, share
from pipelines.engine.files.digest import sha256
from pipelines.engine.files.places import open_files
from pipelines.engine.plan import Plan
from pipelines.engine.pool import OnStepEnd, Pool, StepEnd, cores
from pipelines.engine.store.erasure_notes import interrupted_erasures
from pipelines.engine.store.permissions import warn_if_others_can_write
from pipelines.engine.workspace import Workspace
from pipelines.recordings.calibration_choice import CalibrationPlace, calibration_places, choose_calibration
from pipelines.recordings.captures import read_capture
from pipelines.scan import DELIVERED, CalibrationFile, scan_steps
from schemas.base.errors import RefusedInput
from schemas.frames import GROUP
from schemas.measures import Measures
from schemas.parameters.scan import ScanParameters
from schemas.quality import Quality
from schemas.scan import Scan

CACHE = ".footscan"
"""Name of the store in the results folder, unless the workflow names another place."""
WINDOW = 8
"""Scans per worker whose steps are submitted at once: a bound of memory, which must not grow with the archive."""

log = logging.getLogger("footscan.archive")


@dataclass(frozen=True)
class Job:
    """Scans to reconstruct, with calibrations, parameters, results folder and store."""

    folders: list[Path]
    archives: tuple[Path, ...]
    """Folders that the paths in their scans may not leave; for other scans that is the folder two levels above."""
    calibrations: tuple[CalibrationPlace, ...]
    """Calibrations for scans without their own."""
    calibration_wins: bool
    """True if `calibrations` replace the scans' own calibrations as well."""
    results: Path
    cache: Path | str
    """Folder of the store, or its URL."""
    parameters: ScanParameters
    threads: int
    """Number of steps that run at once in the default pool."""
    group: int | None = None
    """Number of the group that may access the written files as well as their owner."""

    def archive_of(self, folder: Path) -> Path | None:
        """Return the archive that contains a scan; None without one."""
        return next((archive for archive in self.archives if folder.is_relative_to(archive)), None)


class Waiting(NamedTuple):
    """A step that a run would execute, or look up again once its inputs are known."""

    scan: str
    kind: str
    camera: int | None
    name: str
    """See `Step.name`."""
    reason: str


class Refused(NamedTuple):
    """A scan whose input breaks its format."""

    scan: str
    """`patient/scan`; the scan's folder if the name cannot be read or belongs to another scan."""
    folder: Path
    error: RefusedInput


@dataclass(frozen=True)
class PlannedScan:
    """The plan of a scan in numbers."""

    scan: RecordedScan
    steps: int
    """Number of its steps."""
    to_run: int
    """Number of its steps that are not hits."""
    failure: Failure | None
    """Cached reason why the scan cannot be measured, if any."""
    delivered: Mapping[str, str]
    """Digests of those delivered files that are known, by file name."""


@dataclass
class PlannedJob:
    """The plan of a job."""

    job: Job
    workspace: Workspace
    calibrations: dict[Path, CalibrationFile] = field(default_factory=dict)
    """Calibrations by their files."""
    captures: dict[Path, CaptureInputs] = field(default_factory=dict)
    """Captures by their folders."""
    refused: list[Refused] = field(default_factory=list)
    scans: list[PlannedScan] = field(default_factory=list)
    waiting: list[Waiting] = field(default_factory=list)
    """Steps that are not hits; empty unless reasons were asked for."""

    @property
    def steps(self) -> int:
        """Number of steps of all scans."""
        return sum(planned.steps for planned in self.scans)

    @property
    def to_run(self) -> int:
        """Number of steps of all scans that are not hits."""
        return sum(planned.to_run for planned in self.scans)

    @property
    def parameters_sha256(self) -> str:
        """Digest of the parameters of all steps."""
        return sha256(parameters_text(self.job.parameters).encode())


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


def job_of_workflow(path: Path, threads: int | None = None, *, may_be_empty: bool = False) -> Job:
    """Read the job from a workflow.yaml.

    Raises
    ------
    RefusedInput
        The file breaks its format, an archive is missing, all archives are empty and `may_be_empty` is not set, or the
        place of the store is not valid.
    """
    workflow = read_workflow(path)
    check_archives(path, workflow)
    base = path.resolve().parent
    archives = tuple(base / archive for archive in workflow.archive)
    results = base / workflow.results
    folders = [folder for archive in archives for folder in scan_folders(archive)]
    if not folders and not may_be_empty:
        below = ", ".join(map(str, archives))
        raise RefusedInput(path, f"expected folders with a scan.yaml below {below}, found none", field="archive")
    return Job(
        folders=folders,
        archives=archives,
        calibrations=calibration_places(workflow, base),
        calibration_wins=False,
        results=results,
        cache=_cache(path, workflow.cache) or results / CACHE,
        parameters=workflow.parameters,
        threads=threads or workflow.workers or cores(),
        group=None if workflow.group is None else group_number(workflow.group, path),
    )


def job_of_scan(folder: Path, calibration: Path | None, results: Path, threads: int | None = None) -> Job:
    """Make the job of one scan without a workflow; RefusedInput if `results` is a file."""
    if results.exists() and not results.is_dir():
        raise RefusedInput(results, "is a file, expected a folder for the results")
    return Job(
        folders=[folder],
        archives=(),
        calibrations=() if calibration is None else (CalibrationPlace(calibration),),
        calibration_wins=True,
        results=results,
        cache=results / CACHE,
        parameters=ScanParameters(),
        threads=threads or cores(),
    )


def plan_job(job: Job, *, reasons: bool = False, folders: dict[str, Path] | None = None) -> PlannedJob:
    """Build the graph of each scan of a job and look up every step in the cache.

    Parameters
    ----------
    reasons : bool
        True if the steps that are not hits are listed, not only counted.
    folders : dict, optional
        Folders of the scans of earlier jobs on the same archive, by name, so that no results are overwritten; those of
        this job are added.
    """
    planned = PlannedJob(job, workspace_of(job))
    folders = {} if folders is None else folders
    for folder in job.folders:
        name = str(folder)
        try:
            scan = read_scan(folder, job.archive_of(folder))
            other = folders.get(scan.name, folder)
            if other != folder and _is_still(scan.name, other, job.archive_of(other)):
                raise RefusedInput(scan.file, f"{scan.name} is also in {other}, expected each scan once")
            name = scan.name
            folders[name] = folder
            plan = planned.workspace.plan(draw_steps(scan, planned))
        except RefusedInput as error:
            planned.refused.append(Refused(name, folder.resolve(), error))
            continue
        planned.scans.append(_sum_up(scan, plan))
        if reasons:
            planned.waiting += [
                Waiting(scan.name, p.step.kind, p.step.camera, p.step.name, p.reason) for p in plan.to_run
            ]
    return planned


def workspace_of(job: Job) -> Workspace:
    """Open the workspace of a job; RefusedInput as in `Workspace`."""
    return Workspace(job.cache, job.cache if isinstance(job.cache, Path) else job.results / CACHE)


def draw_steps(scan: RecordedScan, planned: PlannedJob) -> list[Step]:
    """Build the steps of one scan of a job, and those of the capture that it is calibrated from, if any.

    Raises
    ------
    RefusedInput
        As in `scan_steps`, `recorded_inputs` and `check_of_scan`, or the scan has no calibration.
    """
    calibration = _calibration(scan, planned)
    parameters, digests = planned.job.parameters, planned.workspace.digests
    if isinstance(calibration, CaptureOfScan):
        steps = scan_steps(scan, calibration, parameters, digests)
        return [*calibration.steps, *steps]
    check = check_of_scan(scan, calibration.digest, calibration.checks)
    return scan_steps(scan, calibration, parameters, digests, check)


def run_job(planned: PlannedJob, pool: Pool, on_step_end: OnStepEnd) -> Iterator[ScanEnd]:
    """Run the steps of a planned job that are not hits, and deliver the results; yields the end of each scan."""
    for name, folder, error in planned.refused:
        yield ScanEnd(name, folder, None, str(error), "refused", parameters_sha256=planned.parameters_sha256)
    waiting = iter(planned.scans)
    share_written(planned)
    warn_if_others_can_write(planned.workspace.store, planned.job.group)
    for name in interrupted_erasures(planned.workspace.store):
        log.warning("%s: its erasure was interrupted, run 'footscan forget' for it again", name)
    # A job that runs no steps needs no lease: it uses only the results that it has looked up.
    held = planned.workspace.lease() if planned.to_run else nullcontext()
    with planned.workspace, held:
        while window := list(islice(waiting, WINDOW * pool.count)):
            yield from _run_window(window, planned, pool, on_step_end)


def share_written(planned: PlannedJob) -> None:
    """Give the group of a job, if it has one, access to all files that its run writes."""
    job = planned.job
    frames = [scan.scan.folder / GROUP for scan in planned.scans if scan.to_run]
    share([job.results, *([job.cache] if isinstance(job.cache, Path) else []), *frames], job.group)


def _cache(workflow: Path, place: str | None) -> Path | str | None:
    """Place of the store that a workflow names. A URL is opened here, so that a wrong one is reported only once."""
    if place is None or "://" not in place:
        return None if place is None else workflow.resolve().parent / place
    try:
        open_files(place)
    except RefusedInput as error:
        raise RefusedInput(workflow, f"{place}: {error.problem}", field="cache") from None
    return place


def _is_still(name: str, folder: Path, archive: Path | None) -> bool:
    """Return True if a scan still lies in the folder where it was found before."""
    try:
        return read_scan(folder, archive).name == name
    except RefusedInput:
        return False


def _sum_up(scan: RecordedScan, plan: Plan) -> PlannedScan:
    outcomes = {p.step.kind: p.outcome for p in plan.steps if p.step.camera is None}
    failures = [p.outcome for p in plan.steps if isinstance(p.outcome, Failure)]
    delivered = {
        file: outcome.digest for file, kind in DELIVERED.items() if isinstance(outcome := outcomes[kind], Success)
    }
    return PlannedScan(scan, len(plan.steps), len(plan.to_run), failures[0] if failures else None, delivered)


def _run_window(
    window: Sequence[PlannedScan], planned: PlannedJob, pool: Pool, on_step_end: OnStepEnd
) -> Iterator[ScanEnd]:
    """Run some scans together; scans without steps to run only have their results delivered."""
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

    outcomes = planned.workspace.run(steps, pool, on_end)
    for scan in window:
        end = _end_scan(scan, outcomes, planned)
        if end.kind == "damaged":
            log.warning("%s", end.problem)
            outcomes_again = planned.workspace.run(draw_steps(scan.scan, planned), pool, on_step_end)
            end = _end_scan(scan, outcomes_again, planned)
        yield end


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
    digests: dict[str, str] = {}
    for file, kind in DELIVERED.items():
        planned_outcome = planned_scan.failure or Success(planned_scan.delivered.get(file, ""))
        outcome = outcomes.get(f"{scan.name}/{kind}", planned_outcome)
        if isinstance(outcome, Failure):
            return replace(ended, problem=outcome.problem + older_results(target), kind=outcome.kind)
        digests[file] = outcome.digest
    problem = planned.workspace.deliver(digests, target)
    if problem is not None:
        has = planned.workspace.store.has  # damaged blobs have been removed
        is_complete = all(has(digest) for digest in digests.values())
        return replace(ended, problem=problem, kind="fault" if is_complete else "damaged")
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


def _calibration(scan: RecordedScan, planned: PlannedJob) -> CalibrationFile | CaptureOfScan:
    job = planned.job
    own = None if job.calibration_wins and job.calibrations else scan.calibration
    place = choose_calibration(scan, job.calibrations) if own is None else CalibrationPlace(own)
    path = place.file
    if place.is_capture:
        if path not in planned.captures:
            planned.captures[path] = recorded_inputs(read_capture(path), planned.workspace.digests)
        return CaptureOfScan.from_capture(scan.name, planned.captures[path])
    if path not in planned.calibrations:
        planned.calibrations[path] = CalibrationFile.read(path)
    return planned.calibrations[path]

"""The plan of a job: the steps of each of its scans, and which of them must run."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from footscan.recordings.calibration_checks import check_of_scan
from footscan.recordings.scans import RecordedScan, read_scan
from pipelines.archive.job import CACHE, Job
from pipelines.archive.selection import Selection, names_of
from pipelines.calibrate import CaptureInputs, CaptureOfScan, recorded_inputs
from pipelines.engine.actions.key import parameters_text
from pipelines.engine.actions.step import Failure, SourceFile, Step, Success
from pipelines.engine.files.digest import sha256
from pipelines.engine.plan import Plan
from pipelines.engine.workspace import Workspace
from pipelines.recordings.calibration_choice import CalibrationPlace, choose_calibration
from pipelines.recordings.captures import read_capture
from pipelines.scan import DELIVERABLE, CalibrationFile, scan_steps
from schemas.base.errors import RefusedInput


class Waiting(NamedTuple):
    """A step that a run would execute, or look up again once its inputs are known."""

    scan: str
    kind: str
    camera: int | None
    name: str
    """See `Step.name`."""
    reason: str
    frame_bytes: int
    """Size of the film whose frames the step would write, about that of the frames; 0 for other steps."""


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
    left_out: list[RecordedScan] = field(default_factory=list)
    """Scans that the job's selection does not take."""

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


def plan_job(job: Job, *, reasons: bool = False, folders: dict[str, Path] | None = None) -> PlannedJob:
    """Build the graph of each scan of a job and look up every step in the cache.

    Parameters
    ----------
    reasons : bool
        True if the steps that are not hits are listed, not only counted.
    folders : dict, optional
        Folders of the scans of earlier jobs on the same archive, by name, so that no results are overwritten; those of
        this job are added.

    Raises
    ------
    RefusedInput
        The job selects scans or steps that do not exist; it may where `folders` are given, since scans still arrive.
    """
    planned = PlannedJob(job, workspace_of(job))
    is_whole, folders = folders is None, {} if folders is None else folders
    known_steps, taken_steps = set[str](), set[str]()
    for folder in job.folders:
        name = str(folder)
        try:
            scan = _read_scan(folder, job.archive_of(folder), planned.workspace)
            other = folders.get(scan.name, folder)
            if other != folder and _is_still(scan.name, other, job.archive_of(other)):
                raise RefusedInput(scan.file, f"{scan.name} is also in {other}, expected each scan once")
            name = scan.name
            folders[name] = folder
            if not job.selection.takes(scan):
                planned.left_out.append(scan)
                continue
            job.fetch(scan)
            steps = _all_steps(scan, planned)
            part = job.selection.part_of(steps)
            if job.selection.names_steps:
                known_steps.update(name for step in steps for name in names_of(step))
                taken_steps.update(name for step in part for name in names_of(step))
            plan = planned.workspace.plan(part, job.selection.force)
        except RefusedInput as error:
            if name in folders or job.selection.takes_unreadable(folder):
                planned.refused.append(Refused(name, folder.resolve(), error))
            continue
        planned.scans.append(_sum_up(scan, plan))
        if reasons:
            planned.waiting += [
                Waiting(scan.name, p.step.kind, p.step.camera, p.step.name, p.reason, _frame_bytes(p.step))
                for p in plan.to_run
            ]
    if is_whole:
        _check_selection(planned, known_steps, taken_steps)
    return planned


def workspace_of(job: Job) -> Workspace:
    """Open the workspace of a job; RefusedInput as in `Workspace`."""
    return Workspace(job.cache, job.cache if isinstance(job.cache, Path) else job.results / CACHE)


def draw_steps(scan: RecordedScan, planned: PlannedJob) -> list[Step]:
    """Build the steps of one scan that a job selects, and those of the capture that it is calibrated from, if any.

    Raises
    ------
    RefusedInput
        As in `scan_steps`, `recorded_inputs` and `check_of_scan`, or the scan has no calibration.
    """
    return planned.job.selection.part_of(_all_steps(scan, planned))


def _all_steps(scan: RecordedScan, planned: PlannedJob) -> list[Step]:
    calibration = _calibration(scan, planned)
    parameters, digests = planned.job.parameters, planned.workspace.digests
    if isinstance(calibration, CaptureOfScan):
        steps = scan_steps(scan, calibration, parameters, digests, wanted=planned.job.wanted)
        return [*calibration.steps, *steps]
    check = check_of_scan(scan, calibration.digest, calibration.checks)
    return scan_steps(scan, calibration, parameters, digests, check, planned.job.wanted)


def _read_scan(folder: Path, archive: Path | None, workspace: Workspace) -> RecordedScan:
    """The scan in `folder`; where the folder cannot be written, its frames lie in the workspace."""
    scan = read_scan(folder, archive)
    if os.access(scan.folder, os.W_OK):
        return scan
    return replace(scan, frames=workspace.frames / scan.document.patient / scan.document.scan)


def _check_selection(planned: PlannedJob, known_steps: set[str], taken_steps: set[str]) -> None:
    """Raise RefusedInput if the job selects scans or steps that do not exist."""
    selection = planned.job.selection
    names = [scan.scan.name for scan in planned.scans] + [scan.name for scan in planned.left_out]
    names += ["/".join(refused.folder.parts[-2:]) for refused in planned.refused]
    for pattern in selection.only:
        if not any(Selection(only=(pattern,)).matches(name) for name in names):
            raise RefusedInput(
                "--only",
                f"no scan matches {pattern[:80]!r}, expected patient/scan, for example {min(names, default='P0042/*')}",
            )
    if known_steps:
        selection.check_steps(known_steps, taken_steps)


def _frame_bytes(step: Step) -> int:
    """Size of the films from which a step writes frames."""
    if step.writes is None or step.places.get("film") == step.places["array"]:  # it was recorded as frames
        return 0
    return sum(
        state.size for source in step.inputs.values() if isinstance(source, SourceFile) for _, state in source.states
    )


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
        file: outcome.digest for file, kind in DELIVERABLE.items() if isinstance(outcome := outcomes.get(kind), Success)
    }
    return PlannedScan(scan, len(plan.steps), len(plan.to_run), failures[0] if failures else None, delivered)


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

"""`footscan run` and `footscan plan`."""

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO

import typer

from pipelines.cli.archive.workers import (
    ClusterAddress,
    Dashboard,
    Placement,
    Threads,
    TlsCa,
    TlsCert,
    TlsKey,
    Workers,
    chosen_pool,
)
from pipelines.cli.terminal.compiling import compile_loops
from pipelines.cli.terminal.output import AsJson, message, print_json, print_line, print_table
from schemas.base.errors import Fault, FootscanError, RefusedInput

if TYPE_CHECKING:
    from pipelines.archive.job import Job, PlannedJob, ScanEnd
    from pipelines.archive.profile import Profile
    from pipelines.engine.pool import Pool, StepEnd

WORKFLOW = Path("workflow.yaml")

WorkflowFile = Annotated[
    Path | None, typer.Argument(help="The workflow; default: workflow.yaml.", metavar="[WORKFLOW]")
]
ScanFolder = Annotated[Path | None, typer.Option("--scan", help="Folder of one scan, instead of a workflow.")]
CalibrationFile = Annotated[
    Path | None, typer.Option("--calibration", help="Calibration for --scan; default: the one named in scan.yaml.")
]
ResultsFolder = Annotated[Path | None, typer.Option("--out", help="Folder for the results of --scan.")]
JsonLog = Annotated[Path | None, typer.Option("--log-json", help="Log file to write, one JSON object per line.")]
ProfilePage = Annotated[
    Path | None, typer.Option("--profile", help="Page to write: which step ran when and where.", metavar="FILE.html")
]
WatchArchive = Annotated[
    bool, typer.Option("--watch", help="Keep running and process scans as they arrive in the archive, until Ctrl-C.")
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Parameter, for example extraction.red_threshold=22, or preset=thesis; may be repeated.",
    ),
]
POLL_S, LONGEST_POLL_S, WATCHED_SHARE = 2.0, 20.0, 0.01
"""Least and most time between two looks at the archives of a watch, and the share of a core that looking may take."""
MANY_STEPS = 20
"""Steps to run from which all loops of a scan are compiled beforehand: fewer may call but a few."""


def run(
    workflow: WorkflowFile = None,
    scan: ScanFolder = None,
    calibration: CalibrationFile = None,
    out: ResultsFolder = None,
    settings: Settings = None,
    threads: Threads = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    dashboard: Dashboard = False,
    tls_ca: TlsCa = None,
    tls_cert: TlsCert = None,
    tls_key: TlsKey = None,
    watch: WatchArchive = False,
    log_json: JsonLog = None,
    profile: ProfilePage = None,
    as_json: AsJson = False,
) -> int:
    """Reconstruct and measure: all scans of a workflow, or one scan folder.

    Nothing that has been computed before is computed again.
    """
    placement = Placement(threads, workers, cluster, dashboard, (tls_ca, tls_cert, tls_key))
    placement.check()
    if watch and (scan is not None or as_json):
        raise RefusedInput("--watch", "goes with a workflow alone, not with --scan or --json")
    profiled = _profile(profile, watch=watch)
    with ExitStack() as stack:
        log = None if log_json is None else stack.enter_context(_log(log_json))
        job = job_of(workflow, scan, calibration, out, threads, settings, may_be_empty=watch)
        pool = stack.enter_context(chosen_pool(job.threads, placement))
        if watch:
            return _watch(job, pool, log)
        ends = _run(job, pool, log, as_json=as_json, profile=profiled)
    if profile is not None and profiled is not None:
        profiled.write(profile)
    if scan is not None:
        return _status(ends, single=True)
    return max(_status(ends, single=False), _write_table(ends, job.results))


def _run(
    job: "Job",
    pool: "Pool",
    log: TextIO | None,
    *,
    as_json: bool = False,
    folders: dict[str, Path] | None = None,
    profile: "Profile | None" = None,
) -> "list[ScanEnd]":
    """Run a job and print the result of each scan; `folders` as in `plan_job`."""
    from pipelines.archive.job import plan_job, run_job
    from pipelines.cli.terminal.progress import StepProgress

    planned = plan_job(job, folders=folders)
    if planned.steps:
        message(_summary(planned))
    if planned.to_run >= MANY_STEPS:
        compile_loops()
    ends = []
    with StepProgress(planned.to_run, len(job.folders), log) as progress:

        def on_step_end(ended: "StepEnd") -> None:
            progress.on_step_end(ended)
            if profile is not None:
                profile.on_step_end(ended)

        for end in run_job(planned, pool, on_step_end):
            progress.on_scan_end(end)
            ends.append(end)
    if as_json:
        print_json(_ends_json(planned, ends, progress.ran))
    for end in ends:
        if end.problem is not None:
            _tell(end.scan, end.problem)
        elif not as_json:
            print_line(f"{end.scan}: {end.folder}")
            for warning in end.warnings:
                message(f"{end.scan}: {warning}")
    return ends


def _profile(path: Path | None, *, watch: bool) -> "Profile | None":
    """The profile that `--profile` asks for."""
    if path is None:
        return None
    from pipelines.archive.profile import Profile, check_place

    if watch:
        raise RefusedInput("--profile", "goes with a run that ends, not with --watch")
    check_place(path)
    return Profile()


def _write_table(ends: "list[ScanEnd]", results: Path) -> int:
    """Write the table of all results; a failure is printed and gives the exit status of a fault."""
    from pipelines.archive.table import write_results_table

    try:
        write_results_table(ends, results)
    except Fault as error:
        message(f"footscan: {error}")
        return error.exit_status
    return 0


def _watch(job: "Job", pool: "Pool", log: TextIO | None) -> int:
    """Run scans as soon as they are complete, until interrupted."""
    from pipelines.archive.watch import Arrivals

    arrivals = Arrivals(job.archives)
    folders: dict[str, Path] = {}
    ends: dict[Path, ScanEnd] = {}
    message(f"watching {', '.join(map(str, job.archives))}")
    looked_s = math.inf
    while True:
        started_s = time.process_time()
        complete = arrivals.complete()
        looked_s = min(looked_s, time.process_time() - started_s)  # the first look also reads each scan.yaml
        if complete:
            ends |= {end.source: end for end in _run(replace(job, folders=complete), pool, log, folders=folders)}
            _write_table([end for source, end in ends.items() if source.is_dir()], job.results)
        time.sleep(min(max(POLL_S, looked_s / WATCHED_SHARE), LONGEST_POLL_S))


@contextmanager
def _log(path: Path) -> Iterator[TextIO]:
    if path.is_dir():
        raise RefusedInput(path, "is a folder, expected the name of a file to write")
    try:
        with path.open("a", encoding="utf-8") as log:
            yield log
    except OSError as error:
        raise Fault(f"{path}: cannot be written ({error.strerror or error})") from None


def plan(
    workflow: WorkflowFile = None,
    scan: ScanFolder = None,
    calibration: CalibrationFile = None,
    out: ResultsFolder = None,
    settings: Settings = None,
    as_json: AsJson = False,
) -> int:
    """Show what `run` would do, and why, without running it."""
    from pipelines.archive.job import plan_job

    planned = plan_job(job_of(workflow, scan, calibration, out, None, settings), reasons=True)
    if as_json:
        print_json(_plan_json(planned))
    else:
        rows = [[w.scan, w.kind, "" if w.camera is None else str(w.camera), w.reason] for w in planned.waiting]
        if rows:
            print_table("", ["scan", "step", "camera", "reason"], rows)
        if planned.steps:
            print_line(_summary(planned))
    for refused in planned.refused:
        _tell(refused.scan, str(refused.error))
    for planned_scan in planned.scans:
        if planned_scan.failure is not None:
            _tell(planned_scan.scan.name, planned_scan.failure.problem)
    if planned.refused:
        return RefusedInput.exit_status if scan is not None else 1
    return 0


def with_settings(job: "Job", settings: list[str] | None) -> "Job":
    """`job` with what `--set` says of its parameters."""
    from pipelines.archive.settings import changed_parameters

    return replace(job, parameters=changed_parameters(job.parameters, settings)) if settings else job


def job_of(
    workflow: Path | None,
    scan: Path | None,
    calibration: Path | None,
    out: Path | None,
    threads: int | None,
    settings: list[str] | None,
    *,
    may_be_empty: bool = False,
) -> "Job":
    """The job described by the options of a command; `may_be_empty` accepts an archive without scans."""
    from pipelines.archive.job import job_of_scan, job_of_workflow

    if scan is None:
        for name, value in (("--calibration", calibration), ("--out", out)):
            if value is not None:
                raise RefusedInput(name, "goes with --scan, expected it in the workflow")
        read = job_of_workflow(workflow or WORKFLOW, threads, may_be_empty=may_be_empty)
        return with_settings(read, settings)
    if workflow is not None:
        raise RefusedInput(workflow, "a workflow and --scan exclude each other, expected one of them")
    if out is None:
        raise RefusedInput("--out", "is missing, expected a folder for the results of --scan")
    return with_settings(job_of_scan(scan, calibration, out, threads), settings)


def _tell(scan: str, problem: str) -> None:
    """One line for a failed scan; most problems name a file of the scan and thereby the scan."""
    message(f"footscan: {problem}" if scan in problem else f"footscan: {scan}: {problem}")


def _summary(planned: "PlannedJob") -> str:
    return f"{planned.to_run} of {planned.steps} steps to run"


def _plan_json(planned: "PlannedJob") -> dict[str, object]:
    failures = [(scan.scan.name, scan.failure) for scan in planned.scans]
    return {
        "steps": planned.steps,
        "hits": planned.steps - planned.to_run,
        "misses": [{"scan": w.scan, "step": w.kind, "camera": w.camera, "reason": w.reason} for w in planned.waiting],
        "refused": [{"scan": refused.scan, "problem": str(refused.error)} for refused in planned.refused],
        "failed": [{"scan": name, "problem": failure.problem} for name, failure in failures if failure is not None],
    }


def _ends_json(planned: "PlannedJob", ends: "list[ScanEnd]", ran: int) -> dict[str, object]:
    return {
        "steps": planned.steps,
        "planned": planned.to_run,
        "ran": ran,
        "scans": [
            {
                "scan": end.scan,
                "status": "done" if end.problem is None else end.kind,
                "results": None if end.folder is None else str(end.folder),
                "problem": end.problem,
                "warnings": list(end.warnings),
            }
            for end in ends
        ],
    }


def _status(ends: "list[ScanEnd]", *, single: bool) -> int:
    kinds = {end.kind for end in ends if end.problem is not None}
    if kinds & {"fault", "damaged"}:
        return FootscanError.exit_status
    if single and "refused" in kinds:
        return RefusedInput.exit_status
    return 1 if kinds else 0

"""`footscan run`."""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO

import typer

from pipelines.cli.archive.printing import print_failure, print_left_out, steps_to_run
from pipelines.cli.archive.selecting import Chosen, Force, Only, Settings, Since, Until, WorkflowFile
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
from pipelines.cli.terminal.output import AsJson, message, note, print_json, print_line
from schemas.base.errors import Fault, FootscanError, RefusedInput

if TYPE_CHECKING:
    from footscan.recordings.scans import RecordedScan
    from pipelines.archive.job import Job
    from pipelines.archive.planning import PlannedJob
    from pipelines.archive.profile import Profile
    from pipelines.archive.running import ScanEnd
    from pipelines.engine.pool import Pool, StepEnd

ScanFolder = Annotated[Path | None, typer.Option("--scan", help="Folder of one scan, instead of a workflow.")]
CalibrationFile = Annotated[
    Path | None, typer.Option("--calibration", help="Calibration for --scan; default: the one named in scan.yaml.")
]
ResultsFolder = Annotated[Path | None, typer.Option("--out", help="Folder for the results of --scan.")]
JsonLog = Annotated[Path | None, typer.Option("--log-json", help="Log file to write, one JSON object per line.")]
Profiles = Annotated[
    list[str] | None,
    typer.Option(
        "--profile",
        metavar="NAME|FILE.html",
        help="Take the options of this profile of the workflow; or write a page: which step ran when and where.",
    ),
]
FailFast = Annotated[
    bool | None,
    typer.Option("--fail-fast/--keep-going", help="End at the first failed scan; default: the others go on."),
]
WatchArchive = Annotated[
    bool, typer.Option("--watch", help="Keep running and process scans as they arrive in the archive, until Ctrl-C.")
]
POLL_S, LONGEST_POLL_S, WATCHED_SHARE = 2.0, 20.0, 0.01
"""Least and most time between two looks at the archives of a watch, and the share of a core that looking may take."""
MANY_STEPS = 20
"""Steps to run from which all loops of a scan are compiled beforehand: fewer may call but a few."""


def run(
    workflow: WorkflowFile = None,
    only: Only = None,
    since: Since = None,
    until: Until = None,
    force: Force = None,
    fail_fast: FailFast = None,
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
    profile: Profiles = None,
    as_json: AsJson = False,
) -> int:
    """Reconstruct and measure: all scans of a workflow, or one scan folder.

    Nothing that has been computed before is computed again.
    """
    placement = Placement(threads, workers, cluster, dashboard, (tls_ca, tls_cert, tls_key))
    placement.check()
    if watch and (scan is not None or as_json):
        raise RefusedInput("--watch", "goes with a workflow alone, not with --scan or --json")
    named, page = _profiles(profile)
    profiled = _profile(page, watch=watch)
    chosen = Chosen(only, since, until, force, settings, named)
    with ExitStack() as stack:
        log = None if log_json is None else stack.enter_context(_log(log_json))
        job = job_of(chosen, workflow, scan, calibration, out, threads, may_be_empty=watch)
        if watch and job.fetched:
            raise RefusedInput("--watch", f"does not look into {job.fetched[0].url}, expected an archive in a folder")
        job = job if fail_fast is None else replace(job, fail_fast=fail_fast)
        pool = stack.enter_context(chosen_pool(job.threads, placement))
        if watch:
            return _watch(job, pool, log)
        planned, ends = _run(job, pool, log, as_json=as_json, profile=profiled)
    if page is not None and profiled is not None:
        profiled.write(page)
        note(f"{page}: which step ran when and where")
    if scan is not None:
        return _status(ends, single=True)
    written = 0 if job.selection.until is not None else _write_table(ends, _not_run(planned), job)
    return max(_status(ends, single=False), written)


def _run(
    job: "Job",
    pool: "Pool",
    log: TextIO | None,
    *,
    as_json: bool = False,
    folders: dict[str, Path] | None = None,
    profile: "Profile | None" = None,
) -> "tuple[PlannedJob, list[ScanEnd]]":
    """Plan and run a job, and print the result of each scan; `folders` as in `plan_job`."""
    from pipelines.archive.planning import plan_job
    from pipelines.archive.running import run_job
    from pipelines.cli.terminal.progress import StepProgress

    planned = plan_job(job, folders=folders)
    print_left_out(planned)
    if planned.steps:
        note(steps_to_run(planned))
    if planned.to_run >= MANY_STEPS:
        from footscan.ahead_of_time import SCAN

        compile_loops(SCAN)
    ends = []
    with StepProgress(planned.to_run, len(planned.scans) + len(planned.refused), log) as progress:

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
            print_failure(end.scan, end.problem)
        elif not as_json:
            print_line(f"{end.scan}: {end.folder or f'done until {end.until}'}")
            for warning in end.warnings:
                message(f"{end.scan}: {warning}")
    if len(ends) < (count := len(planned.scans) + len(planned.refused)):
        message(f"footscan: ended at the first failed scan; {count - len(ends)} of {count} scans are not done")
    return planned, ends


def _profiles(values: list[str] | None) -> tuple[str | None, Path | None]:
    """The name of a profile and the page to write, one of each at most, as `--profile` has them."""
    pages = [value for value in values or () if value.endswith(".html")]
    names = [value for value in values or () if not value.endswith(".html")]
    for many in (pages, names):
        if len(many) > 1:
            raise RefusedInput("--profile", f"expected one profile and one page, found {many[0]!r} and {many[1]!r}")
    return next(iter(names), None), Path(pages[0]) if pages else None


def _profile(path: Path | None, *, watch: bool) -> "Profile | None":
    """The profile that `--profile` asks for."""
    if path is None:
        return None
    from pipelines.archive.profile import Profile, check_place

    if watch:
        raise RefusedInput("--profile", "goes with a run that ends, not with --watch")
    check_place(path)
    return Profile()


def _write_table(ends: "list[ScanEnd]", not_run: "Sequence[RecordedScan]", job: "Job") -> int:
    """Write the table of all results; a failure is printed and gives the exit status of a fault."""
    from pipelines.archive.table import update_results_table

    try:
        update_results_table(ends, not_run, job)
    except Fault as error:
        message(f"footscan: {error}")
        return error.exit_status
    return 0


def _not_run(planned: "PlannedJob") -> "list[RecordedScan]":
    """Scans that the job leaves out, or left where it ended early."""
    return [*planned.left_out, *(one.scan for one in planned.scans)]


def _watch(job: "Job", pool: "Pool", log: TextIO | None) -> int:
    """Run scans as soon as they are complete, until interrupted."""
    from pipelines.archive.watch import Arrivals

    arrivals = Arrivals(job.archives)
    folders: dict[str, Path] = {}
    ends: dict[Path, ScanEnd] = {}
    not_run: dict[Path, RecordedScan] = {}
    note(f"watching {', '.join(map(str, job.archives))}")
    looked_s = math.inf
    while True:
        started_s = time.process_time()
        complete = arrivals.complete()
        looked_s = min(looked_s, time.process_time() - started_s)  # the first look also reads each scan.yaml
        if complete:
            planned, ended = _run(replace(job, folders=complete), pool, log, folders=folders)
            ends |= {end.source: end for end in ended}
            not_run |= {scan.folder: scan for scan in _not_run(planned)}
            present = [scan for source, scan in not_run.items() if source.is_dir()]
            _write_table([end for source, end in ends.items() if source.is_dir()], present, job)
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


def job_of(
    chosen: Chosen,
    workflow: Path | None,
    scan: Path | None,
    calibration: Path | None,
    out: Path | None,
    threads: int | None,
    *,
    may_be_empty: bool = False,
) -> "Job":
    """The job described by the options of a command; `may_be_empty` accepts an archive without scans."""
    if scan is None:
        for name, value in (("--calibration", calibration), ("--out", out)):
            if value is not None:
                raise RefusedInput(name, "goes with --scan, expected it in the workflow")
        return chosen.job(workflow, threads, may_be_empty=may_be_empty)
    if workflow is not None:
        raise RefusedInput(workflow, "a workflow and --scan exclude each other, expected one of them")
    if out is None:
        raise RefusedInput("--out", "is missing, expected a folder for the results of --scan")
    return chosen.of_scan(scan, calibration, out, threads)


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

"""`footscan run` and `footscan plan`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.output import AsJson, message, print_json, print_table
from schemas.errors import FootscanError, RefusedInput

if TYPE_CHECKING:
    from pipelines.archive import Job, PlannedJob, ScanEnd

WORKFLOW = Path("workflow.yaml")

WorkflowFile = Annotated[
    Path | None, typer.Argument(help="The workflow; workflow.yaml where absent.", metavar="[WORKFLOW]")
]
ScanFolder = Annotated[Path | None, typer.Option("--scan", help="One scan folder, without a workflow.")]
CalibrationFile = Annotated[
    Path | None, typer.Option("--calibration", help="Calibration for --scan; the one that the scan names where absent.")
]
ResultsFolder = Annotated[Path | None, typer.Option("--out", help="Folder of the results, for --scan.")]
Workers = Annotated[
    int | None, typer.Option("--workers", min=1, help="Steps that run at once; as many as cores where absent.")
]


def run(
    workflow: WorkflowFile = None,
    scan: ScanFolder = None,
    calibration: CalibrationFile = None,
    out: ResultsFolder = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> int:
    """Reconstruct and measure: all scans of a workflow, or one scan folder.

    Nothing that has been computed before is computed again.
    """
    from pipelines.archive import plan_job, run_job
    from pipelines.cli.progress import StepProgress

    job = _job(workflow, scan, calibration, out, workers)
    planned = plan_job(job)
    if planned.steps:
        message(_summary(planned))
    with StepProgress(planned.to_run) as progress:
        ends = list(run_job(planned, progress.on_step_end))
    if as_json:
        print_json(_ends_json(planned, ends, progress.ran))
    for end in ends:
        if end.problem is not None:
            _tell(end.scan, end.problem)
        elif not as_json:
            print(f"{end.scan}: {end.folder}")
    return _status(ends, single=scan is not None)


def plan(
    workflow: WorkflowFile = None,
    scan: ScanFolder = None,
    calibration: CalibrationFile = None,
    out: ResultsFolder = None,
    as_json: AsJson = False,
) -> int:
    """Say what `run` would do, and why, without doing it."""
    from pipelines.archive import plan_job

    planned = plan_job(_job(workflow, scan, calibration, out, None), reasons=True)
    if as_json:
        print_json(_plan_json(planned))
    else:
        rows = [[w.scan, w.kind, "" if w.camera is None else str(w.camera), w.reason] for w in planned.waiting]
        if rows:
            print_table("", ["scan", "step", "camera", "reason"], rows)
        if planned.steps:
            print(_summary(planned))
    for folder, error in planned.refused.items():
        _tell(folder, str(error))
    for planned_scan in planned.scans:
        if planned_scan.failure is not None:
            _tell(planned_scan.scan.name, planned_scan.failure.problem)
    if planned.refused:
        return RefusedInput.exit_status if scan is not None else 1
    return 0


def _job(
    workflow: Path | None, scan: Path | None, calibration: Path | None, out: Path | None, workers: int | None
) -> "Job":
    from pipelines.archive import job_of_scan, job_of_workflow

    if scan is None:
        for name, value in (("--calibration", calibration), ("--out", out)):
            if value is not None:
                raise RefusedInput(name, "goes with --scan, expected it in the workflow")
        return job_of_workflow(workflow or WORKFLOW, workers)
    if workflow is not None:
        raise RefusedInput(workflow, "a workflow and --scan exclude each other, expected one of them")
    if out is None:
        raise RefusedInput("--out", "is missing, expected a folder for the results of --scan")
    return job_of_scan(scan, calibration, out, workers)


def _tell(scan: str, problem: str) -> None:
    """One line for a scan that failed; most problems name a file of the scan and so the scan itself."""
    message(f"footscan: {problem}" if scan in problem else f"footscan: {scan}: {problem}")


def _summary(planned: "PlannedJob") -> str:
    return f"{planned.to_run} of {planned.steps} steps to run"


def _plan_json(planned: "PlannedJob") -> dict[str, object]:
    failures = [(scan.scan.name, scan.failure) for scan in planned.scans]
    return {
        "steps": planned.steps,
        "hits": planned.steps - planned.to_run,
        "misses": [{"scan": w.scan, "step": w.kind, "camera": w.camera, "reason": w.reason} for w in planned.waiting],
        "refused": [{"scan": folder, "problem": str(error)} for folder, error in planned.refused.items()],
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

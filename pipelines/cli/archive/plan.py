"""`footscan plan`."""

from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.archive.printing import duration, print_failure, print_left_out, steps_to_run
from pipelines.cli.archive.run import CalibrationFile, ResultsFolder, ScanFolder, job_of
from pipelines.cli.archive.selecting import Chosen, Force, Only, ProfileName, Settings, Since, Until, WorkflowFile
from pipelines.cli.terminal.output import AsJson, figure, print_json, print_line, print_table
from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.archive.planning import PlannedJob

SummedUp = Annotated[
    bool, typer.Option("--summary", help="Show the steps by kind and reason, with the time and bytes they will take.")
]


def plan(
    workflow: WorkflowFile = None,
    only: Only = None,
    since: Since = None,
    until: Until = None,
    force: Force = None,
    profile: ProfileName = None,
    scan: ScanFolder = None,
    calibration: CalibrationFile = None,
    out: ResultsFolder = None,
    settings: Settings = None,
    summary: SummedUp = False,
    as_json: AsJson = False,
) -> int:
    """Show what `run` would do, and why, without running it."""
    from pipelines.archive.planning import plan_job

    chosen = Chosen(only, since, until, force, settings, profile)
    planned = plan_job(job_of(chosen, workflow, scan, calibration, out, None), reasons=True)
    print_left_out(planned)
    if as_json:
        print_json(_json(planned, with_summary=summary))
    elif summary:
        _print_summary(planned)
    else:
        rows = [[w.scan, w.kind, "" if w.camera is None else str(w.camera), w.reason] for w in planned.waiting]
        if rows:
            print_table("", ["scan", "step", "camera", "reason"], rows)
        if planned.steps:
            print_line(steps_to_run(planned))
    for refused in planned.refused:
        print_failure(refused.scan, str(refused.error))
    for planned_scan in planned.scans:
        if planned_scan.failure is not None:
            print_failure(planned_scan.scan.name, planned_scan.failure.problem)
    if planned.refused:
        return RefusedInput.exit_status if scan is not None else 1
    return 0


def _print_summary(planned: "PlannedJob") -> None:
    from pipelines.archive.summary import summary_of, total

    lines = summary_of(planned)
    if lines:
        print_table(
            "",
            ["step", "reason", "steps", "seconds", "MB to write"],
            [
                [
                    one.kind,
                    one.reason,
                    str(one.steps),
                    figure(one.seconds, ".1f"),
                    figure(None if one.size is None else one.size / 1e6, ".2f"),
                ]
                for one in lines
            ],
        )
    print_line(f"{steps_to_run(planned)}, of {len(planned.scans)} scans")
    seconds, size = total([one.seconds for one in lines]), total([one.size for one in lines])
    if lines and seconds is not None and size is not None:
        workers = planned.job.threads
        text = f"at most {duration(seconds / workers)} with {workers} steps at once, and {size / 1e6:.1f} MB to write"
        unknown = [one.kind for one in lines if one.seconds is None]
        print_line(text + (f"; without {', '.join(dict.fromkeys(unknown))}, which never ran here" if unknown else ""))
    elif lines:
        frames = "" if size is None else f"; frames of {size / 1e6:.1f} MB"
        print_line(f"no such step ever ran here: its time and the size of its result are not known{frames}")


def _json(planned: "PlannedJob", *, with_summary: bool) -> dict[str, object]:
    from pipelines.archive.summary import summary_of

    failures = [(scan.scan.name, scan.failure) for scan in planned.scans]
    document: dict[str, object] = {
        "steps": planned.steps,
        "hits": planned.steps - planned.to_run,
        "misses": [{"scan": w.scan, "step": w.kind, "camera": w.camera, "reason": w.reason} for w in planned.waiting],
        "refused": [{"scan": refused.scan, "problem": str(refused.error)} for refused in planned.refused],
        "failed": [{"scan": name, "problem": failure.problem} for name, failure in failures if failure is not None],
    }
    if with_summary:
        lines = [one._asdict() for one in summary_of(planned)]
        return {name: value for name, value in document.items() if name != "misses"} | {"summary": lines}
    return document

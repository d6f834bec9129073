"""`footscan why`."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.archive.selecting import Chosen, Force, Only, ProfileName, Settings, Since, Until
from pipelines.cli.terminal.output import AsJson, print_json, print_line, print_table
from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.archive.job import Job
    from pipelines.archive.planning import PlannedJob, PlannedScan
    from pipelines.engine.actions.step import Step
    from pipelines.engine.explain import Change
    from pipelines.engine.plan import Plan, PlannedStep
    from pipelines.engine.store.store import Row, Store

SHOWN_LINES = 40
"""Lines shown of one change in a table; the JSON has all."""


@dataclass(frozen=True)
class Explanation:
    """State of a step and the reason for it."""

    step: "Step"
    state: str
    """`hit`, `miss` or `waits`."""
    reason: str
    changes: "tuple[Change, ...]"
    """Changes since the last action of the step."""
    last: "Row | None"
    """Row of the last action of the step; for a hit, of the present one."""
    made: float | None
    """Time of the row, s since 1970."""


def why(
    scan: Annotated[
        str | None, typer.Argument(help="Folder of a scan, or patient/scan; default: all scans of the workflow.")
    ] = None,
    step: Annotated[
        str | None, typer.Argument(help="A step, such as extract or extract-3; default: all steps that would run.")
    ] = None,
    workflow: Annotated[Path | None, typer.Option(help="The workflow; default: workflow.yaml.")] = None,
    calibration: Annotated[Path | None, typer.Option(help="Calibration, for a scan folder without a workflow.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the results, for a scan folder without a workflow.")
    ] = None,
    only: Only = None,
    since: Since = None,
    until: Until = None,
    force: Force = None,
    profile: ProfileName = None,
    settings: Settings = None,
    as_json: AsJson = False,
) -> None:
    """Show what changed since the last result of each step that would run, old and new side by side."""
    from pipelines.archive.planning import plan_job

    options = Chosen(only, since, until, force, settings, profile)
    planned = plan_job(_job(scan, options, workflow, calibration, out))
    for refused in planned.refused:
        raise refused.error
    if scan is not None and not planned.scans:
        raise RefusedInput(scan, "is left out by --only, --since or the profile, expected a scan that they take")
    documents = [_why_of_scan(found, planned, step, as_json=as_json) for found in planned.scans]
    if as_json:
        print_json(documents if scan is None else documents[0])


def _why_of_scan(found: "PlannedScan", planned: "PlannedJob", step: str | None, *, as_json: bool) -> dict[str, Any]:
    """Explain the steps of one scan, as a table or as the document that is returned."""
    plan = plan_of_scan(found, planned)
    every = [_explain(one, plan, planned.workspace.store) for one in plan.steps]
    chosen = _named(step, every) if step is not None else [one for one in every if one.state != "hit"]
    if as_json:
        return _json(found.scan.name, every, chosen)
    if chosen:
        if len(planned.scans) > 1:
            print_line(f"{found.scan.name}:")
        _show(chosen)
    else:
        newest = _newest(every)
        print_line(f"{found.scan.name}: nothing would run; last result: {_short(newest.step)}, {_came_to(newest)}")
    return {}


def plan_of_scan(found: "PlannedScan", planned: "PlannedJob") -> "Plan":
    """The plan of one scan of a job, with all its selected steps."""
    from pipelines.archive.planning import draw_steps

    return planned.workspace.plan(draw_steps(found.scan, planned), planned.job.selection.force)


def local_time(seconds: float | None) -> str:
    """A time, s since 1970, as local text."""
    return "at an unknown time" if seconds is None else f"{datetime.fromtimestamp(seconds):%Y-%m-%d %H:%M:%S}"


def json_time(seconds: float | None) -> str | None:
    """A time, s since 1970, in ISO 8601."""
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds")


def scan_of_job(
    scan: str, options: Chosen, workflow: Path | None, calibration: Path | None, out: Path | None
) -> "tuple[Job, Path]":
    """The job of a scan, which may be a folder or `patient/scan`, and the folder of the scan among its folders."""
    if out is not None:
        if workflow is not None:
            raise RefusedInput("--workflow", "and --out exclude each other, expected one of them")
        return options.of_scan(Path(scan), calibration, out), Path(scan)
    if calibration is not None:
        raise RefusedInput("--calibration", "goes with --out, expected it in the workflow")
    job = options.job(workflow)
    return job, _folder(scan, job)


def _job(scan: str | None, options: Chosen, workflow: Path | None, calibration: Path | None, out: Path | None) -> "Job":
    """The job of the one scan, or of the workflow."""
    if scan is not None:
        job, folder = scan_of_job(scan, options, workflow, calibration, out)
        return replace(job, folders=[folder])
    if out is not None or calibration is not None:
        raise RefusedInput("SCAN", "is missing, expected the folder of a scan with --out and --calibration")
    return options.job(workflow)


def _folder(scan: str, job: "Job") -> Path:
    """The folder of a scan that is given as a folder or as `patient/scan`."""
    from footscan.recordings.scans import read_scan

    named = Path(scan).resolve()
    for folder in job.folders:
        if folder.resolve() == named:
            return folder
    for folder in sorted(job.folders, key=lambda folder: not folder.as_posix().endswith(f"/{scan}")):
        try:
            if read_scan(folder, job.archive_of(folder)).name == scan:
                return folder
        except RefusedInput:
            continue
    archives = ", ".join(map(str, job.archives))
    raise RefusedInput(scan, f"no such scan in the workflow's archive {archives}, expected a folder or patient/scan")


def _named(step: str, every: Sequence[Explanation]) -> list[Explanation]:
    chosen = [one for one in every if step in {one.step.name, _short(one.step), one.step.kind}]
    if not chosen:
        kinds = ", ".join(dict.fromkeys(one.step.kind for one in every))
        raise RefusedInput(step, f"no such step, expected one of {kinds}; one camera's as extract-3")
    return chosen


def _explain(planned: "PlannedStep", plan: "Plan", store: "Store") -> Explanation:
    from pipelines.engine.actions.key import image_text, key_of
    from pipelines.engine.audit import input_digests
    from pipelines.engine.explain import changes, inputs_of
    from pipelines.engine.files.names import row_name

    step = planned.step
    digests = input_digests(step, {one.step.name: one.outcome for one in plan.steps})
    state, reason = planned.state.value, planned.reason
    known_changes: Sequence[Change] = ()
    is_complete = digests.keys() == step.inputs.keys()
    if state == "hit" and is_complete:
        key = key_of(image_text(step, digests))
    else:
        latest = store.latest(step.name)
        key = "" if latest is None else latest.key
    last = store.row(key) if key else None
    if state == "hit":
        reason = "would not run" if is_complete else "fails with a step before it"
    elif last is not None:
        # An input that is still to be made counts as unchanged: the changes of all others can be shown already.
        before = {name: digest for name, (_, digest) in inputs_of(last.image).items()}
        present = {name: digests.get(name, before.get(name, "")) for name in step.inputs}
        known_changes = changes(step, last.image, json.loads(image_text(step, present)), store)
    return Explanation(
        step, state, reason, tuple(known_changes), last, store.files.written(row_name(key)) if last else None
    )


def _newest(every: Sequence[Explanation]) -> Explanation:
    return max(every, key=lambda one: one.made or 0.0)


def _show(chosen: Sequence[Explanation]) -> None:
    """Print one table for all steps with the same changes, such as those of the cameras."""
    alike: dict[tuple[str, tuple[object, ...]], list[Explanation]] = {}
    for one in chosen:
        alike.setdefault((one.reason, one.changes), []).append(one)
    for (reason, _), steps in alike.items():
        print_line(f"{', '.join(_short(one.step) for one in steps)}: {reason}")
        if steps[0].last is not None:
            print_line(f"  last result: {_came_to(steps[0])}" + ", and others" * (len(steps) > 1))
        rows = [row for change in steps[0].changes for row in _rows(change)]
        if rows:
            print_table("", ["changed", "last time", "now"], rows)


def _rows(change: "Change") -> list[list[str]]:
    """Rows with old and new side by side; of texts only the lines that differ."""
    from pipelines.engine.explain import side_by_side

    made_by = f" (result of {change.step})" if change.step else ""
    what = f"{change.what} {change.name}{made_by}"
    if change.what == "code" and (change.old is None or change.new is None):
        missing = "its text is not in the store"
        if change.old is None and change.new is None:
            return [[what, missing, ""]]
        return [[what, "-" if change.old is None else "was there", "-" if change.new is None else "is there"]]
    if change.what != "code" and "\n" not in f"{change.old}{change.new}":
        return [[what, _value(change.old), _value(change.new)]]
    pairs = side_by_side(change)
    rows = [["", old, new] for old, new in pairs[:SHOWN_LINES]]
    if len(pairs) > SHOWN_LINES:
        rows.append(["", f"... {len(pairs) - SHOWN_LINES} more lines", ""])
    return [[what, *rows[0][1:]], *rows[1:]] if rows else [[what, "", ""]]


def _value(text: str | None) -> str:
    if text is None:
        return "-"
    return text[:12] if _is_digest(text) else text


def _is_digest(text: str) -> bool:
    return len(text) == 64 and text.isalnum()


def _came_to(one: Explanation) -> str:
    """Result of the last action of a step, and its time."""
    if one.last is None:
        return "none"
    result = one.last.failure[1] if one.last.failure is not None else f"{one.last.digest}"[:12]
    return f"{_plain(result, one.step)} of {local_time(one.made)}"


def _plain(problem: str, step: "Step") -> str:
    from pipelines.engine.plan import with_places

    return with_places(problem, step.places)


def _short(step: "Step") -> str:
    """`extract-3`."""
    return step.name.removeprefix(f"{step.scan}/")


def _json(scan: str, every: Sequence[Explanation], chosen: Sequence[Explanation]) -> dict[str, Any]:
    return {
        "scan": scan,
        "steps": len(every),
        "to_run": sum(one.state != "hit" for one in every),
        "explained": [
            {
                "step": _short(one.step),
                "state": one.state,
                "reason": one.reason,
                "last": _last_json(one),
                "changes": [_change_json(change) for change in one.changes],
            }
            for one in chosen
        ],
        "last": None if chosen else _last_json(_newest(every)),
    }


def _last_json(one: Explanation) -> dict[str, Any] | None:
    if one.last is None:
        return None
    problem = None if one.last.failure is None else _plain(one.last.failure[1], one.step)
    made = json_time(one.made)
    return {"step": _short(one.step), "made": made, "digest": one.last.digest, "problem": problem}


def _change_json(change: "Change") -> dict[str, Any]:
    from pipelines.engine.explain import side_by_side

    facts: dict[str, Any] = {"what": change.what, "name": change.name, "step": change.step}
    if change.what == "code" or "\n" in f"{change.old}{change.new}":
        return {**facts, "lines": side_by_side(change)}
    return {**facts, "old": change.old, "new": change.new}

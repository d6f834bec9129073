"""`footscan cache upgrade`."""

import re
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.archive.selecting import WORKFLOW, WorkflowFile
from pipelines.cli.terminal.output import AsJson, message, print_json, print_line, print_table
from schemas.base.errors import RefusedInput, one_line

if TYPE_CHECKING:
    from pipelines.archive.upgrade import Trial

SHOWN_CHANGES = 4
"""Changes shown of each step in the table; the JSON has all."""


def upgrade(
    workflow: WorkflowFile = None,
    sample: Annotated[int, typer.Option(min=1, help="Number of actions per kind of step that are computed again.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the sample.")] = 0,
    accept: Annotated[
        str | None,
        typer.Option(
            metavar="REASON", help="Keep the old results of steps whose sample agrees, and record this reason."
        ),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """After an upgrade: compute a sample again and show what differs; with --accept, keep the results that agree.

    A step is stale when its inputs and parameters are those of its last result, and only its code or the version of a
    library that it computes with is new. The exit status is 1 if a step of the sample differs or fails.
    """
    from pipelines.archive.job import job_of_workflow
    from pipelines.archive.planning import plan_job
    from pipelines.archive.upgrade import accept_upgrade, try_upgrade

    if accept is not None and not accept.strip():
        raise RefusedInput("--accept", "expected a reason, which 'footscan trace' will show")
    planned = plan_job(job_of_workflow(workflow or WORKFLOW))
    with planned.workspace:
        trials = try_upgrade(planned, sample, seed)
        kept = accept_upgrade(planned, trials, accept.strip()) if accept is not None else None
    if as_json:
        print_json({"steps": [_json(trial) for trial in trials], "accepted": kept})
    else:
        _print(trials, kept)
    for refused in planned.refused:
        message(f"footscan: {refused.error}")
    return int(bool(planned.refused) or any(not trial.agrees for trial in trials))


def _print(trials: "list[Trial]", kept: int | None) -> None:
    if not trials:
        print_line("no step is stale: nothing was computed under another version")
        return
    print_table(
        "stale steps",
        ["step", "stale", "computed again", "differ", "what is new"],
        [
            [
                trial.upgrade.kind,
                str(len(trial.stale)),
                str(len(trial.sample)),
                str(len(trial.differences) + len(trial.problems)),
                _shortened(trial.changes),
            ]
            for trial in trials
        ],
    )
    for trial in trials:
        for difference, words in trial.differences:
            how = f": {words}" if words else ""
            outcomes = f"recorded {_short(difference.recorded)}, now {_short(difference.found)}"
            message(f"footscan: {difference.step}: differs{how} ({outcomes})")
        for problem in trial.problems:
            message(f"footscan: {problem}")
    if kept is not None:
        print_line(f"{kept} result{'s' * (kept != 1)} accepted under the new version")
    elif any(trial.agrees for trial in trials):
        print_line("nothing was accepted: --accept REASON keeps the results of the steps that agree")


def _shortened(changes: list[str]) -> str:
    more = f", and {len(changes) - SHOWN_CHANGES} more" if len(changes) > SHOWN_CHANGES else ""
    return ", ".join(changes[:SHOWN_CHANGES]) + more


def _short(outcome: str) -> str:
    """The first digits of a digest; a failure as it is."""
    return outcome[:12] if re.fullmatch("[0-9a-f]{64}", outcome) else one_line(outcome)


def _json(trial: "Trial") -> dict[str, Any]:
    return {
        "kind": trial.upgrade.kind,
        "code": {"old": trial.upgrade.old, "new": trial.upgrade.new},
        "changes": trial.changes,
        "stale": len(trial.stale),
        "sample": len(trial.sample),
        "differences": [
            {"step": one.step, "recorded": one.recorded, "found": one.found, "difference": words}
            for one, words in trial.differences
        ],
        "problems": trial.problems,
        "agrees": trial.agrees,
    }

"""`footscan tune`."""

from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.cli.archive.selecting import WORKFLOW, Chosen, Settings, WorkflowFile
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
from pipelines.cli.terminal.output import AsJson, figure, message, note, print_json, print_line, print_table
from schemas.base.errors import Fault, RefusedInput

if TYPE_CHECKING:
    from pipelines.tuning.report.result import Gain, Trial
    from pipelines.tuning.search import Tuned


def tune(
    workflow: WorkflowFile = None,
    settings: Settings = None,
    threads: Threads = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    dashboard: Dashboard = False,
    tls_ca: TlsCa = None,
    tls_cert: TlsCert = None,
    tls_key: TlsKey = None,
    as_json: AsJson = False,
) -> int:
    """Search for better parameters, as described in the section tune of a workflow.

    What has been computed before is not computed again; a search that was interrupted goes on where it was.
    """
    from pipelines.archive.workflow_file import read_workflow
    from pipelines.cli.terminal.progress import StepProgress
    from pipelines.tuning.files import write_files
    from pipelines.tuning.search import FOLDER, tune

    placement = Placement(threads, workers, cluster, dashboard, (tls_ca, tls_cert, tls_key))
    placement.check()
    path = workflow or WORKFLOW
    document = read_workflow(path)
    if document.tune is None:
        raise RefusedInput(path, "is missing, expected what is sought", field="tune")
    job = Chosen(settings=settings).job(path, threads)
    folder = job.results / FOLDER
    with chosen_pool(job.threads, placement) as pool, StepProgress(None) as progress:
        tuned = tune(job, document.tune, pool, progress.on_step_end, _tell_trial)
    write_files(folder, path, document, tuned.result, tuned.parameters)
    if as_json:
        print_json(_as_json(tuned, folder))
    else:
        _print(tuned, folder)
    for scan, problem in tuned.refused.items():
        message(f"footscan: {problem}" if scan in problem else f"footscan: {scan}: {problem}")
    for scan, problem in tuned.result.winner.problems.items():
        message(f"footscan: {scan}: {problem}")
    if tuned.faults:
        message(f"footscan: scans failed {tuned.faults} times by a fault of the machine; run again to try these anew")
        return Fault.exit_status
    return 1 if tuned.refused or tuned.result.winner.problems else 0


def _tell_trial(trial: "Trial") -> None:
    name = f"trial {trial.number}" if trial.number else "present"
    values = ", ".join(f"{goal} {value:.4g}" for goal, value in trial.values.items())
    failed = f"; {len(trial.problems)} scans failed: {next(iter(trial.problems.values()))}" if trial.problems else ""
    note(f"{name}: {values}{failed}")


def _print(tuned: "Tuned", folder: Path) -> None:
    from pipelines.tuning.report.page import sentences

    result = tuned.result
    present = result.trials[0].point
    rows = [[name, str(present[name]), str(value)] for name, value in result.winner.point.items()]
    print_table("Parameters", ["name", "present", "winner"], rows)
    rows = [
        [kind, gain.goal.name, gain.goal.unit, *(figure(value, ".4f") for value in _gain(gain)), gain.verdict]
        for kind, gains in (("decided", result.gains), ("held out", result.held_out))
        for gain in gains
    ]
    print_table("Winner beside present", ["scans", "objective", "", "present", "winner", "gain", "spread", ""], rows)
    for line in [*sentences(result), *result.notes]:
        print_line(line)
    print_line(f"{len(result.trials) - 1} trials, {tuned.ran.get('extract', 0)} films extracted: {folder}")


def _gain(gain: "Gain") -> tuple[float | None, ...]:
    present, winner = gain.means
    return present, winner, gain.mean, gain.spread


def _as_json(tuned: "Tuned", folder: Path) -> dict[str, object]:
    result = tuned.result
    return {
        "results": str(folder),
        "winner": result.winner.number,
        "present": dict(result.trials[0].point),
        "parameters": dict(result.winner.point),
        "objectives": [
            {"name": g.name, "unit": g.unit, "meaning": g.meaning, "larger_is_better": g.larger_is_better}
            for g in result.goals
        ],
        "decided": [_gain_json(gain) for gain in result.gains],
        "held_out": [_gain_json(gain) for gain in result.held_out],
        "notes": list(result.notes),
        "trials": [
            {"trial": t.number, "parameters": dict(t.point), "values": dict(t.values), "on_front": t.on_front,
             "problems": dict(t.problems)}
            for t in result.trials
        ],
        "ran": dict(tuned.ran),
        "refused": dict(tuned.refused),
    }  # fmt: skip


def _gain_json(gain: "Gain") -> dict[str, object]:
    present, winner = gain.means
    return {
        "objective": gain.goal.name, "unit": gain.goal.unit, "present": present, "winner": winner,
        "gain": gain.mean, "spread": gain.spread, "verdict": gain.verdict, "data_sets": len(gain.sets),
        "improved": gain.improved,
    }  # fmt: skip

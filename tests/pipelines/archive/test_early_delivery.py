"""What a person waits for is delivered before verification and report, to new scans alone."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from pipelines.archive.job import job_of_workflow
from pipelines.archive.planning import draw_steps, plan_job
from pipelines.archive.running import run_job
from pipelines.engine.actions.step import steps_to
from pipelines.engine.pool import StepEnd, Threads
from pipelines.steps import report


def run(workflow: Path, watched: Path) -> dict[str, set[str]]:
    """Run a workflow; returns which files of the watched results were there at the end of each step, by its kind."""
    seen: dict[str, set[str]] = {}

    def on_step_end(end: StepEnd) -> None:
        seen[end.step.kind] = {file.name for file in watched.glob("*")}

    list(run_job(plan_job(job_of_workflow(workflow)), Threads(1), on_step_end))
    return seen


def test_stl_and_measures_are_there_before_the_report_is_made(archive: Any) -> None:
    seen = run(archive.workflow, archive.results)
    assert seen["surface"] == set()
    assert {"foot.stl", "measures.json"} <= seen["quality.json"]
    assert "report.html" not in seen["quality.json"]
    assert (archive.results / "report.html").is_file()


def test_files_that_are_known_are_there_at_once(archive: Any) -> None:
    """As after a scan that was measured ahead."""
    planned = plan_job(job_of_workflow(archive.workflow))
    scan = planned.scans[0].scan
    steps = steps_to(draw_steps(scan, planned), [f"{scan.name}/measure"])
    with planned.workspace as workspace:
        workspace.run(steps, Threads(1), lambda _: None)
    seen = run(archive.workflow, archive.results)
    assert "measure" not in seen
    assert "measures.json" in seen["foot.stl"]


def test_earlier_results_are_replaced_all_at_once(done: Any) -> None:
    before = {file: file.read_bytes() for file in done.results.iterdir()}
    shutil.rmtree(done.root / "results/.footscan")
    workflow = done.workflow.read_text()
    done.workflow.write_text(f"{workflow}parameters:\n  surface:\n    grid_steps: 1.5\n")
    unchanged = []

    def on_step_end(_: StepEnd) -> None:
        unchanged.append({file: file.read_bytes() for file in done.results.iterdir()} == before)

    list(run_job(plan_job(job_of_workflow(done.workflow)), Threads(1), on_step_end))
    assert all(unchanged)
    assert {file: file.read_bytes() for file in done.results.iterdir()} != before


def test_a_run_that_fails_after_the_measures_does_not_speak_of_an_earlier_one(
    archive: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> bytes:
        raise ValueError("no ink")

    monkeypatch.setattr(report, "run", broken)
    [end] = run_job(plan_job(job_of_workflow(archive.workflow)), Threads(1), lambda _: None)
    assert end.problem is not None
    assert "no ink" in end.problem
    assert "earlier run" not in end.problem
    assert (archive.results / "measures.json").is_file()

"""`footscan tune` from the command line."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from pipelines.cli.main import run_command
from tests.helpers.steps import LEFT_BY_A_SEARCH

SEARCH = """\
tune:
  search:
    outliers.shortest: [2, 3]
  objectives: [completeness]
  sampler: grid
"""


@pytest.fixture(scope="module")
def sought(pristine: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home in which a search has been made."""
    home = Path(shutil.copytree(pristine, tmp_path_factory.mktemp("sought") / "home"))
    workflow = home / "workflow.yaml"
    workflow.write_text(workflow.read_text() + SEARCH)
    assert run_command(["tune", str(workflow)]) == 0
    return home


@pytest.fixture
def workflow(sought: Path, tmp_path: Path) -> Path:
    """Of an archive in which that search has been made before."""
    return Path(shutil.copytree(sought, tmp_path / "home")) / "workflow.yaml"


def test_a_search_is_told(workflow: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["tune", str(workflow), "--json"]) == 0
    out, err = capsys.readouterr()
    told = json.loads(out)
    assert [trial["parameters"] for trial in told["trials"]] == [{"outliers.shortest": n} for n in (3, 2, 3)]
    assert told["ran"] == {}
    assert told["decided"][0]["data_sets"] == 1
    assert err.splitlines()[0].startswith("present: completeness ")
    assert {path.name for path in Path(told["results"]).iterdir()} >= {
        "best.yaml", "index.html", "trials.csv", "trials.parquet",
    }  # fmt: skip
    assert run_command(["tune", str(workflow)]) == 0
    out, _ = capsys.readouterr()
    assert "2 trials, 0 films extracted" in out
    assert "No scan was held out" in out


def test_the_best_workflow_is_one_to_run(workflow: Path, capsys: pytest.CaptureFixture[str]) -> None:
    best = workflow.parent / "results/tune/best.yaml"
    assert run_command(["config", "check", str(best)]) == 0
    capsys.readouterr()
    assert run_command(["plan", str(best), "--json"]) == 0
    planned = json.loads(capsys.readouterr().out)
    assert (planned["refused"], planned["failed"]) == ([], [])
    steps = {miss["step"] for miss in planned["misses"]}
    assert steps == LEFT_BY_A_SEARCH


def test_a_search_leaves_what_was_last_run_alone(workflow: Path) -> None:
    """Steps of trials have names of their own: none of them is what 'why' tells of a scan."""
    latest = [path.read_text() for path in (workflow.parent / "results/.footscan/latest").rglob("*.json")]
    assert latest
    assert all('"step":"tune/' in text for text in latest)


def test_settings_change_what_is_present(workflow: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["tune", str(workflow), "--json", "--set", "outliers.shortest=5"]) == 0
    assert json.loads(capsys.readouterr().out)["present"] == {"outliers.shortest": 5}


def test_processes_try_what_threads_would(workflow: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One value more, tried by workers; then all again by threads, which find it known."""
    workflow.write_text(workflow.read_text().replace("[2, 3]", "[2, 3, 4]"))
    assert run_command(["tune", str(workflow), "--workers", "1", "--json"]) == 0
    out, err = capsys.readouterr()
    by_workers = json.loads(out)
    assert "dashboard" not in err
    assert by_workers["ran"]["clean"] > 0
    assert run_command(["tune", str(workflow), "--json"]) == 0
    by_threads = json.loads(capsys.readouterr().out)
    assert by_threads["ran"] == {}
    assert by_threads["trials"] == by_workers["trials"]
    assert [trial["parameters"]["outliers.shortest"] for trial in by_threads["trials"]] == [3, 2, 3, 4]
    assert run_command(["tune", str(workflow), "--workers", "1", "--threads", "2"]) == 2


@pytest.mark.parametrize(
    ("section", "problem"),
    [
        ("", "tune: is missing, expected what is sought"),
        ("tune: {search: {}}", "tune.search: "),
        ("tune: {search: {outliers.shorest: [1]}}", "did you mean 'outliers.shortest'? (line 6, column 35)"),
        ("tune: {search: {outliers.shortest: {low: 5, high: 2}}}", "expected low below high"),
        ("tune: {search: {outliers.shortest: {low: 1.5, high: 2}}}", "is a whole number"),
        ("tune: {search: {outliers.shortest: {low: 0, high: 2}}}", "greater than or equal to 1, found '0'"),
        ("tune: {search: {surface.method: {low: 0, high: 2}}}", "is no number, expected a list of values"),
        ("tune: {search: {surface.method: [closed, open]}}", "found 'open'"),
        ("tune: {search: {surface.method: [closed, closed]}}", "expected each value once"),
        ("tune: {search: {outliers.shortest: [1]}, objectives: [speed]}", "found 'speed'"),
        ("tune: {search: {outliers.shortest: [1]}, objectives: [time, time]}", "each objective once"),
        ("tune: {search: {outliers.shortest: [1]}, held_out: 1.5}", "less than 1, found '1.5'"),
        ("tune: {search: {outliers.shortest: [1]}, held_out: P0001/*}", "holds all scans out"),
        ("tune: {search: {outliers.shortest: [1]}, objectives: [repeatability]}", "needs two scans"),
        ("tune: {search: {outliers.gap_mm: {low: 1, high: 2}}, sampler: grid}", "range without a step"),
        ("tune: {search: {outliers.gap_mm: {low: 1, high: 2, lg: true}}}", "lg: unknown field"),
    ],
)
def test_what_cannot_be_sought_is_refused(
    archive: Any, capsys: pytest.CaptureFixture[str], section: str, problem: str
) -> None:
    archive.workflow.write_text(archive.workflow.read_text() + section + "\n")
    assert run_command(["tune", str(archive.workflow)]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert problem in line
    assert not (archive.root / "archive/P0001/S1/frames.zarr").exists()

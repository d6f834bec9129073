"""A search over the small archive: steps that run, reused results, and the outcome."""

import csv
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pyarrow import parquet

from pipelines.archive.job import job_of_workflow
from pipelines.archive.planning import plan_job
from pipelines.engine.pool import StepEnd, Threads
from pipelines.tuning.files import write_files
from pipelines.tuning.report.result import Trial
from pipelines.tuning.search import FOLDER, Tuned, tune
from schemas.base.errors import RefusedInput
from schemas.base.yaml_files import read_yaml
from schemas.workflow import Workflow
from tests.helpers.steps import LEFT_BY_A_SEARCH

GRID = """\
tune:
  search:
    extraction.red_threshold: [12, 60]
    outliers.shortest: [2, 3]
  sampler: grid
"""
TPE = GRID.replace("grid", "tpe\n  trials: 4")
CONE = trimesh.creation.cylinder(radius=36, height=190, sections=64)


def count(ran: list[str], kind: str) -> int:
    """Count the steps of a kind that ran."""
    return sum(re.fullmatch(rf"tune/.*/{kind}(-\d+)?", name) is not None for name in ran)


class Bench:
    """A workflow with a search, and the steps that it runs."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.workflow = root / "workflow.yaml"
        self.ran: list[str] = []

    def seek(self, section: str, on_trial: Callable[[Trial], None] = lambda _: None) -> Tuned:
        before = self.workflow.read_text().partition("tune:")[0]
        self.workflow.write_text(before + section)
        document = read_yaml(self.workflow, Workflow)
        assert document.tune is not None
        self.ran = []
        tuned = tune(job_of_workflow(self.workflow), document.tune, Threads(2), self._hear, on_trial)
        write_files(self.folder, self.workflow, document, tuned.result, tuned.parameters)
        return tuned

    def _hear(self, end: StepEnd) -> None:
        if end.ran:
            self.ran.append(end.step.name)

    @property
    def folder(self) -> Path:
        return self.root / "results" / FOLDER

    def add_scan(self, name: str, spoil: int | None = None) -> None:
        """The scan again, of other films: a pixel's worth of each is changed, or what follows a byte is cut off."""
        scan = self.root / "archive" / name
        shutil.copytree(self.root / "archive/P0001/S1", scan, ignore=shutil.ignore_patterns("frames.zarr"))
        document = scan / "scan.yaml"
        patient, _, own = name.partition("/")
        text = document.read_text().replace("patient: P0001", f"patient: {patient}").replace("scan: S1", f"scan: {own}")
        document.write_text(text)
        for film in sorted(scan.glob("*.avi")):
            data = bytearray(film.read_bytes())
            starts = [found.start() for found in re.finditer(b"\xff\xd8\xff", data)]
            data[(starts[3] + starts[4]) // 2] ^= 1 + len(name) + int(own[1:])
            film.write_bytes(data if spoil is None else data[:spoil])

    def name_truth(self, name: str) -> None:
        """A cylinder about the travel, which differs slightly from the filmed object."""
        mesh = CONE.copy()
        mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
        mesh.apply_translation((95, 0, 40))
        mesh.export(self.root / "archive" / name / "truth.stl")
        document = self.root / "archive" / name / "scan.yaml"
        document.write_text(document.read_text() + "truth: truth.stl\n")


@pytest.fixture(scope="module")
def searched(pristine: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Tuned, list[str]]:
    """A folder with a finished grid search over one scan that names a truth; its outcome, and the steps that ran."""
    root = tmp_path_factory.mktemp("searched") / "home"
    shutil.copytree(pristine, root)
    bench = Bench(root)
    bench.name_truth("P0001/S1")
    return root, bench.seek(GRID), bench.ran


@pytest.fixture
def bench(searched: tuple[Path, Tuned, list[str]], tmp_path: Path) -> Bench:
    """A copy of that folder, to continue in."""
    return Bench(Path(shutil.copytree(searched[0], tmp_path / "home")))


def test_each_film_is_extracted_once_for_each_extraction(searched: tuple[Path, Tuned, list[str]]) -> None:
    root, tuned, ran = searched
    assert count(ran, "ingest") == 2
    assert count(ran, "extract") == 3 * 2  # thresholds 12 and 60 and the present 18, two cameras
    assert tuned.ran["extract"] == 6
    assert count(ran, "clean") <= 5
    assert not {"measure", "report", "foot.stl", "judge"} & tuned.ran.keys()
    assert not list((root / "results").glob("P*"))
    assert [dict(trial.point) for trial in tuned.result.trials] == [
        {"extraction.red_threshold": threshold, "outliers.shortest": shortest}
        for threshold, shortest in ((18, 3), (12, 2), (12, 3), (60, 2), (60, 3))
    ]
    best = min(tuned.result.trials, key=lambda trial: trial.values["accuracy"])
    assert tuned.result.winner.values == best.values
    assert tuned.parameters.extraction.red_threshold == best.point["extraction.red_threshold"]


def test_nothing_is_left_for_a_second_search(bench: Bench) -> None:
    before = {path.name: path.read_bytes() for path in bench.folder.iterdir()}
    bench.seek(GRID)
    assert bench.ran == []
    assert {path.name: path.read_bytes() for path in bench.folder.iterdir()} == before


def test_the_table_and_the_best_workflow(bench: Bench, searched: tuple[Path, Tuned, list[str]]) -> None:
    _, tuned, _ = searched
    with (bench.folder / "trials.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    table = parquet.read_table(bench.folder / "trials.parquet").to_pylist()
    assert [int(row["trial"]) for row in rows] == [row["trial"] for row in table] == [0, 1, 2, 3, 4]
    assert [row["accuracy_mm"] for row in table] == [trial.values["accuracy"] for trial in tuned.result.trials]
    assert [row["accuracy_mm:P0001/S1"] for row in table] == [row["accuracy_mm"] for row in table]
    assert sum(row["winner"] for row in table) == 1
    best = bench.folder / "best.yaml"
    job, present = job_of_workflow(best), job_of_workflow(bench.workflow)
    assert job.parameters == tuned.parameters
    assert job.results.resolve() == present.results.resolve()
    assert [folder.resolve() for folder in job.folders] == [folder.resolve() for folder in present.folders]
    # What the search has made of the winner is known to a run of it, which only writes the rest.
    planned = plan_job(job, reasons=True)
    assert planned.refused == []
    left = {waiting.kind for waiting in planned.waiting}
    assert left == LEFT_BY_A_SEARCH


def test_one_more_data_set_runs_only_what_is_new(bench: Bench) -> None:
    bench.add_scan("P0002/S2")
    bench.seek(GRID)
    assert {name.rpartition("/")[0] for name in bench.ran} == {"tune/P0002/S2"}
    assert count(bench.ran, "extract") == 3 * 2
    assert count(bench.ran, "ingest") == 2


class StopError(Exception):
    """The exception that interrupts a search."""


def test_a_search_that_was_interrupted_goes_on_where_it_was(bench: Bench, tmp_path: Path) -> None:
    other = Bench(Path(shutil.copytree(bench.root, tmp_path / "other")))
    whole = other.seek(TPE).result

    def stop(trial: Trial) -> None:
        if trial.number == 2:
            raise StopError

    with pytest.raises(StopError):
        bench.seek(TPE, stop)
    told: list[Trial] = []
    after = bench.seek(TPE, told.append).result
    assert [trial.number for trial in told] == [0, 1, 2, 3, 4]
    assert after.trials == whole.trials
    assert after.winner == whole.winner


def test_held_out_scans_take_no_part_and_test_the_winner(bench: Bench) -> None:
    bench.add_scan("P0002/S2")
    tuned = bench.seek(GRID + "  held_out: P0002/*\n").result
    assert count(bench.ran, "extract") == 2 * 2 if tuned.winner.number else 2  # present and winner
    [gain] = tuned.held_out
    assert list(gain.sets) == ["P0002/S2"]
    assert list(tuned.gains[0].sets) == ["P0001/S1"]
    present, winner = gain.sets["P0002/S2"]
    assert gain.mean == pytest.approx(present - winner)
    assert gain.spread is None
    assert not any("held out" in note for note in tuned.notes)


def test_scans_that_are_not_meant_are_not_looked_at(bench: Bench) -> None:
    bench.add_scan("P0002/S2")
    for film in (bench.root / "archive/P0002/S2").glob("*.avi"):
        film.unlink()  # it would be refused
    assert bench.seek(GRID + "  data: P0001/*\n").refused == {}
    assert list(bench.seek(GRID).refused) == ["P0002/S2"]


def test_what_held_out_scans_do_not_tell_is_said(bench: Bench) -> None:
    bench.add_scan("P0002/S2")
    scan = bench.root / "archive/P0002/S2/scan.yaml"
    scan.write_text(scan.read_text().replace("truth: truth.stl\n", ""))
    tuned = bench.seek("tune: {search: {outliers.shortest: [2]}, sampler: grid, held_out: P0002/*}\n").result
    assert tuned.held_out == []
    assert "The held-out scans do not test accuracy." in tuned.notes


def test_without_truth_the_cameras_stand_in(bench: Bench) -> None:
    scan = bench.root / "archive/P0001/S1/scan.yaml"
    scan.write_text(scan.read_text().replace("truth: truth.stl\n", ""))
    tuned = bench.seek(GRID.replace("[12, 60]", "[12]").replace("[2, 3]", "[2]"))
    assert [goal.name for goal in tuned.result.goals] == ["disagreement"]
    assert "No scan names a truth" in tuned.result.notes[0]
    assert "No scan names a truth" in (bench.folder / "index.html").read_text()
    assert count(bench.ran, "extract") == 0


def test_scans_that_fail_count_as_the_worst_and_are_told(bench: Bench) -> None:
    bench.add_scan("P0002/S2", spoil=100)
    broken = bench.root / "archive/P0003/S3"
    broken.mkdir(parents=True)
    (broken / "scan.yaml").write_text("format: footscan.scan/1\n")
    tuned = bench.seek(GRID.replace("[12, 60]", "[12]") + "  objectives: [completeness]\n")
    first = tuned.result.trials[0]
    assert list(first.problems) == ["P0002/S2"]
    assert first.of_sets["completeness"]["P0002/S2"] is None
    assert first.of_sets["completeness"]["P0001/S1"] > 1
    assert any("in 3 of 3 trials" in note.lower() for note in tuned.result.notes)
    assert list(tuned.refused) == [str(broken)]


def test_a_scan_of_which_an_objective_is_not_known_has_failed(bench: Bench) -> None:
    scan = bench.root / "archive/P0001/S1/scan.yaml"
    scan.write_text(scan.read_text().replace("  - {id: 5, file: cam5.avi}\n", ""))
    tuned = bench.seek("tune: {search: {outliers.shortest: [2]}, sampler: grid, objectives: [disagreement]}\n")
    assert {trial.values["disagreement"] for trial in tuned.result.trials} == {100.0}
    assert all(trial.problems.keys() == {"P0001/S1"} for trial in tuned.result.trials)


def test_parameters_that_contradict_each_other_are_a_bad_trial(bench: Bench) -> None:
    tuned = bench.seek("tune: {search: {extraction.smallest_contrast: [4, 12]}, sampler: random, trials: 2, seed: 3}\n")
    values = {trial.point["extraction.smallest_contrast"]: trial for trial in tuned.result.trials[1:]}
    assert values[4.0].values["accuracy"] == 100.0
    assert "faintest_contrast: expected at most" in values[4.0].problems["P0001/S1"]
    assert values[12.0].values == tuned.result.trials[0].values
    assert tuned.result.winner.number == 0


def test_time_is_measured_where_it_is_not_known(bench: Bench) -> None:
    for journal in bench.folder.glob("trials-*.jsonl"):
        journal.unlink()
    tuned = bench.seek("tune: {search: {outliers.shortest: [2]}, sampler: grid, objectives: [time]}\n")
    assert all(trial.values["time"] > 0.02 for trial in tuned.result.trials)
    assert bench.ran == [name for name in bench.ran if "ingest" not in name and "extract" not in name]
    again = bench.seek("tune: {search: {outliers.shortest: [2]}, sampler: grid, objectives: [time]}\n")
    assert len(again.result.trials) == 2


def test_a_pattern_that_fits_nothing_is_refused(bench: Bench) -> None:
    with pytest.raises(RefusedInput, match=r"tune\.data: no scan that can be read is called 'P0009/\*'"):
        bench.seek(GRID + "  data: P0009/*\n")

"""A night with the small archive: without changes, with changes, and with failures."""

import re
import shutil
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from pipelines.engine.pool import StepEnd
from pipelines.regression.history import alone, read_history
from pipelines.regression.night import Night, Regression, read_suite, run_night
from pipelines.regression.report.result import JudgedFigure, JudgedSet
from pipelines.steps import clean, report, surface
from schemas.base.errors import Fault, Finding, RefusedInput
from schemas.regression import Acceptance

SUITE = """\
format: footscan.suite/1
timed_passes: 0
sets:
  foot: {scan: archive/P0001/S1, calibration: calibration.json}
"""


def ignore(_: object) -> None:
    """Ignore the end of a step."""


def reason(text: str) -> Acceptance:
    return Acceptance(reason=text, date=datetime(2026, 11, 20, tzinfo=UTC), by="ann", software="footscan 0")


def night(root: Path, suite: str = SUITE, accept: str | None = None) -> Night:
    (root / "suite.yaml").write_text(suite)
    return run_night(
        read_suite(root / "suite.yaml"), ignore, ignore, None if accept is None else reason(accept)
    )  # fmt: skip


def with_parameters(parameters: str) -> str:
    return SUITE.replace("calibration.json", f"calibration.json, parameters: {parameters}")


def only(found: Night) -> JudgedSet:
    [one] = found.result.sets
    return one


def figure(one: JudgedSet, name: str) -> JudgedFigure:
    return next(figure for figure in one.figures if figure.name == name)


@pytest.fixture(scope="module")
def accepted(pristine: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("accepted") / "home"
    shutil.copytree(pristine, root)
    first = night(root)
    assert (first.status, only(first).problem) == (1, None)  # there is no baseline yet
    assert {one.verdict for one in only(first).figures} == {"new"}
    assert night(root, accept="first results").status == 0
    return root


@pytest.fixture
def root(accepted: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(accepted, tmp_path / "home"))


def test_nothing_has_changed(root: Path) -> None:
    found = night(root)
    assert (found.status, only(found).first, only(found).changed_steps) == (0, [], 0)
    assert {one.verdict for one in only(found).figures} == {"same"}
    assert figure(only(found), "steps.all").value == 21
    assert figure(only(found), "steps.run_again").value == 0
    assert {f.name for f in only(found).figures if f.name.startswith("files.")} == {
        "files.foot.stl_off_mm",
        "files.foot.ply_off_mm",
        "files.cloud.ply_off_mm",
    }
    assert all(f.value is not None and f.value < 1e-4 for f in only(found).figures if f.name.startswith("files."))
    assert len(figure(only(found), "points.stripe").history) == 3
    assert [one.reason for one in found.result.accepted] == ["first results"]


@pytest.mark.parametrize(
    ("parameters", "steps", "change", "worse"),
    [
        ("{extraction: {red_threshold: 60}}", ["extract-1", "extract-5"], "red_threshold: 18 → 60", "points.stripe"),
        ("{outliers: {z_mm: [5, 120]}}", ["clean"], "z_mm: None → [5.0, 120.0]", "points.removed"),
        ("{surface: {grid_steps: 1.25}}", ["surface"], "grid_steps: 0.625 → 1.25", "surface.triangles"),
    ],
)
def test_the_first_step_and_what_changed_in_it(
    root: Path, parameters: str, steps: list[str], change: str, worse: str
) -> None:
    found = night(root, with_parameters(parameters))
    one = only(found)
    assert (found.status, one.problem) == (1, None)
    [first] = one.first
    assert list(first.steps) == steps
    assert [told.text for told in first.changes] == [f"parameter {change.replace(': ', ' changed: ', 1)}"]
    assert figure(one, worse).verdict == "worse"
    assert len(one.pictures) == 4
    assert all(caption.startswith("surface: distance to the accepted one, at most ") for caption in one.pictures)
    assert f"foot: {worse}" in read_history(root / "nights").ended[-1].worse


def test_a_baseline_of_another_kind_of_machine(root: Path) -> None:
    """On the other machine every step differs by rounding, but no figure does."""
    accepted = root / "baseline.steps.yaml"
    accepted.write_text(re.sub(r'(key|result): "[0-9a-f]{64}"', rf'\1: "{"e" * 64}"', accepted.read_text()))
    (root / "nights/good.steps.yaml").write_text("damaged: [")
    first = night(root)
    assert (first.status, only(first).changed_steps) == (0, 21)
    assert [list(one.steps) for one in only(first).first] == [["ingest-1", "ingest-5"]]
    assert (night(root).status, only(night(root)).first) == (0, [])
    for grid_steps in (1.25, 1.3):  # a bad night does not become the last good one
        worse = night(root, with_parameters(f"{{surface: {{grid_steps: {grid_steps}}}}}"))
        [one] = only(worse).first
        assert list(one.steps) == ["surface"]
        assert [told.text for told in one.changes] == [f"parameter grid_steps changed: 0.625 → {grid_steps}"]
        captions = list(only(worse).pictures)
        assert len(captions) == 4
        assert captions[0].startswith("surface: distance to that of the last good night, at most ")


def test_figures_that_are_worse_than_accepted_though_no_step_has_changed(root: Path) -> None:
    night(root, with_parameters("{surface: {grid_steps: 1.25}}"), accept="coarser")
    night(root, accept="finer")
    accepted = root / "baseline.yaml"
    coarse = root / "coarse"
    coarse.mkdir()
    shutil.copytree(root / "nights", coarse / "nights")
    night(root, with_parameters("{surface: {grid_steps: 1.25}}"), accept="coarser again")
    shutil.rmtree(root / "nights")
    shutil.move(coarse / "nights", root / "nights")  # a machine that has not seen what was accepted since
    assert "coarser again" in accepted.read_text()
    one = only(night(root))
    assert figure(one, "surface.triangles").verdict == "worse"
    assert [list(first.steps) for first in one.first] == [["surface"]]


def test_a_camera_that_is_no_more(root: Path) -> None:
    document = root / "archive/P0001/S1/scan.yaml"
    document.write_text(document.read_text().replace("  - {id: 5, file: cam5.avi}\n", ""))
    one = only(night(root))
    assert [(list(first.steps), first.why) for first in one.first] == [(["ingest-5"], "no longer exists")]
    assert figure(one, "points.camera-5").verdict == "missing"


def test_a_set_that_fails_is_told_and_its_figures_are_missing(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object) -> bytes:
        raise Finding("no foot there")

    monkeypatch.setattr(clean, "run", none)
    found = night(root, with_parameters("{outliers: {z_mm: [-149, 120]}}"))
    assert found.status == 1
    assert only(found).problem is not None
    assert str(only(found).problem).startswith("no foot there")
    assert figure(only(found), "points.stripe").verdict == "missing"
    assert only(found).first[0].why == "no result: finding"
    with pytest.raises(RefusedInput, match="--accept: expected all sets to run to their end, foot did not: no foot"):
        night(root, with_parameters("{outliers: {z_mm: [-149, 120]}}"), accept="whatever")


def test_a_fault_is_another_status(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> bytes:
        raise Fault("disk full")

    monkeypatch.setattr(surface, "run", full)
    found = night(root, with_parameters("{surface: {grid_steps: 1.5}}"))
    assert found.status == 3
    assert [(list(first.steps), first.why) for first in only(found).first] == [(["surface"], "no result: fault")]
    assert read_history(root / "nights").ended[-1].status == 3


def test_a_fault_far_behind_the_step_that_changed(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> bytes:
        raise Fault("disk full")

    monkeypatch.setattr(report, "run", full)
    one = only(night(root, with_parameters("{outliers: {z_mm: [5, 120]}}")))
    assert [list(first.steps) for first in one.first] == [["clean"]]


def test_sets_come_and_go(root: Path) -> None:
    more = SUITE + "  more: {scan: archive/P0001/S1, calibration: calibration.json}\n"
    found = night(root, more)
    assert found.status == 0
    assert {one.name: one.count("new") > 0 for one in found.result.sets} == {"foot": False, "more": True}
    gone = night(root, SUITE.replace("foot:", "other:"))
    assert gone.status == 1
    assert {one.name: one.problem for one in gone.result.sets} == {"other": None, "foot": "is no longer in the suite"}


def test_a_night_at_a_time_and_one_that_was_killed(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with alone(root / "nights"), pytest.raises(Fault, match="another night is under way"):
        night(root)

    def interrupted(*_: object, **__: object) -> Any:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("pipelines.regression.night.run_set", interrupted)
        with pytest.raises(KeyboardInterrupt):
            night(root)
    assert len(read_history(root / "nights").unfinished) == 1
    [told] = night(root).result.notes
    assert told.endswith("UTC began and did not end.")


def test_time_and_memory_are_taken_with_an_empty_cache(root: Path) -> None:
    ran: list[StepEnd] = []
    (root / "suite.yaml").write_text(SUITE.replace("timed_passes: 0", "timed_passes: 1"))
    frames = sorted((root / "archive").rglob("zarr.json"))
    touched = [file.stat().st_mtime_ns for file in frames]
    regression: Regression = read_suite(root / "suite.yaml")
    one = only(run_night(regression, ran.append, ignore))
    assert not any(end.ran for end in ran)  # the results come from the cache,
    figures = {figure.name: figure.value or 0.0 for figure in one.figures}
    assert figures["time.extract"] > 0  # the times do not
    assert figures["time.surface"] > 0
    kinds = [value for name, value in figures.items() if name.startswith("time.") and name != "time.total"]
    assert figures["time.total"] == pytest.approx(sum(kinds), abs=1.0)  # each is rounded
    assert figures["memory.peak_mb"] > 50
    assert figures["steps.unsteady"] == 0
    assert one.count("worse", "missing") == 0
    assert [file.stat().st_mtime_ns for file in frames] == touched
    assert list((root / "nights/results/foot").glob(".timed-*")) == []


def test_parameters_that_do_not_fit_are_refused_before_the_night(root: Path) -> None:
    told = r"suite.yaml: sets.foot.parameters.extraction.red_treshold: unknown field, did you mean 'red_threshold'"
    with pytest.raises(RefusedInput, match=told):
        night(root, with_parameters("{extraction: {red_treshold: 20}}"))
    assert len(read_history(root / "nights").ended) == 2

"""A job: a failed scan is reported in one line, does not stop the others, and is cached."""

import itertools
import json
import re
import shutil
import uuid
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fsspec.implementations.memory import MemoryFileSystem

from pipelines.archive.job import job_of_scan, job_of_workflow
from pipelines.archive.planning import plan_job
from pipelines.archive.running import run_job
from pipelines.engine import run as engine_run
from pipelines.engine.pool import StepEnd, Threads
from pipelines.steps import measure
from schemas.base.errors import Fault, Finding, RefusedInput
from schemas.base.yaml_files import read_yaml
from schemas.calibration import Calibration
from schemas.parameters.scan import ScanParameters
from schemas.scan import Scan


def add_scan(archive: Any, name: str, old: str = "", new: str = "") -> Path:
    """A copy of the first scan under another name, with something of its document exchanged."""
    folder = archive.scan.with_name(name)
    shutil.copytree(archive.scan, folder, ignore=shutil.ignore_patterns("frames.zarr"))
    document = folder / "scan.yaml"
    document.write_text(document.read_text().replace("scan: S1", f"scan: {name}").replace(old, new))
    return folder


def test_each_broken_scan_is_one_line_and_the_rest_is_whole(done: Any) -> None:
    truncated = add_scan(done, "S2") / "cam1.avi"
    truncated.write_bytes(truncated.read_bytes()[:-5000])
    missing = add_scan(done, "S3") / "cam5.avi"
    missing.unlink()
    hostile = add_scan(done, "S4", "patient: P0001", "patient: ../../x") / "scan.yaml"
    broken = add_scan(done, "S5", "side: right", "side: [right") / "scan.yaml"
    leaving = add_scan(done, "S6", "cam5.avi", "../../../../cam5.avi") / "scan.yaml"
    twice = add_scan(done, "S7", "scan: S7", "scan: S1") / "scan.yaml"
    empty = add_scan(done, "S8") / "cam1.avi"
    empty.write_bytes(b"")
    also_empty = add_scan(done, "S9") / "cam5.avi"
    also_empty.write_bytes(b"")
    for _ in range(2):
        scans, ran = done.run()
        problems = {scan.scan.rpartition("/")[2]: (scan.kind, scan.problem or "") for scan in scans}
        assert all(problem.isprintable() for _, problem in problems.values())
        assert problems["S1"] == (None, "")
        length = truncated.stat().st_size + 5000
        assert problems["S2"] == ("refused", f"{truncated}: length: truncated: 5000 of {length} bytes are missing")
        assert problems["S3"] == ("refused", f"{missing}: no such film")
        assert problems["S4"][1].startswith(f"{hostile}: patient: expected 1 to 64 letters, digits, '-' and '_'")
        assert problems["S5"][1].startswith(f"{broken}: line 5, column 7: ")
        expected = "file of camera 5: '../../../../cam5.avi' leaves the archive, expected a path inside it"
        assert problems["S6"] == ("refused", f"{leaving}: {expected}")
        assert problems["S7"][1] == f"{twice}: P0001/S1 is also in {done.scan}, expected each scan once"
        assert problems["S8"] == ("refused", f"{empty}: header: expected an AVI film")
        assert problems["S9"] == ("refused", f"{also_empty}: header: expected an AVI film")
    assert ran == set()
    assert [path.name for path in (done.root / "results/P0001").iterdir()] == ["S1"]


def test_no_later_job_overwrites_the_scan_of_an_earlier_one(done: Any) -> None:
    """Plan as in a watch, where each new scan is a job of its own."""
    folders: dict[str, Path] = {}

    def refused(folder: Path) -> list[str]:
        planned = plan_job(replace(done.job(), folders=[folder]), folders=folders)
        return [str(refusal.error) for refusal in planned.refused]

    assert refused(done.scan) == refused(done.scan) == []
    twin = add_scan(done, "S0", "scan: S0", "scan: S1")
    assert refused(twin) == [f"{twin / 'scan.yaml'}: P0001/S1 is also in {done.scan}, expected each scan once"]
    assert refused(done.scan) == []  # who came first keeps the name
    document = done.scan / "scan.yaml"
    document.write_text(document.read_text().replace("scan: S1", "scan: other"))
    assert refused(twin) == []  # and has given it up
    shutil.rmtree(twin)
    assert refused(add_scan(done, "S2", "scan: other", "scan: S1")) == []


def test_a_scan_that_lacks_a_film_is_told_by_its_name(done: Any) -> None:
    (add_scan(done, "S2", "scan: S2", "scan: late") / "cam5.avi").unlink()
    unreadable = add_scan(done, "S3", "side: right", "side: [right")
    twin = add_scan(done, "S4", "scan: S4", "scan: S1")
    (twin / "cam5.avi").unlink()
    ends, _ = done.run()
    assert [(end.scan, end.source.name) for end in ends] == [
        ("P0001/late", "S2"), (str(unreadable), "S3"), (str(twin), "S4"), ("P0001/S1", "S1")
    ]  # fmt: skip


def test_what_cannot_be_remembered_of_films_is_no_fault(
    archive: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("pipelines.engine.files.digest.SETTLED_NS", 0)
    files = archive.root / "results/.footscan/files.json"
    files.mkdir(parents=True)
    [scan], _ = archive.run()
    assert scan.problem is None
    assert caplog.messages[-1] == f"{files}: cannot be written (Is a directory); the next run will read all films again"


def test_finding_fails_its_scan_and_is_remembered(archive: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object) -> bytes:
        raise Finding("no foot in the surface")

    monkeypatch.setattr(measure, "run", none)
    [scan], ran = archive.run()
    assert (scan.problem, scan.kind, scan.folder) == ("no foot in the surface", "finding", None)
    assert "measure" in ran
    assert archive.plan() == (21, {})
    assert archive.run() == ([scan], set())
    assert not archive.results.exists()


def test_defect_costs_its_scan_and_is_tried_again(done: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    add_scan(done, "S2", "step_mm: 10.0", "step_mm: 10.5")
    with monkeypatch.context() as patch:
        patch.setattr(measure, "run", lambda *_: 1 // 0)
        scans, _ = done.run()
        assert [(scan.scan, scan.kind) for scan in scans] == [("P0001/S1", None), ("P0001/S2", "fault")]
        assert scans[1].problem == "P0001/S2/measure: ZeroDivisionError: integer division or modulo by zero"
    scans, ran = done.run()
    assert [scan.problem for scan in scans] == [None, None]
    assert ran == {"P0001/S2/measure", "P0001/S2/sizes.json", "P0001/S2/quality.json", "P0001/S2/report"}


def test_equal_films_of_two_scans_that_start_together_are_gone_through_once(archive: Any) -> None:
    add_scan(archive, "S2")
    ends: list[StepEnd] = []
    scans = list(run_job(plan_job(archive.job()), Threads(4), ends.append))
    assert [scan.problem for scan in scans] == [None, None]
    ran = sorted(end.step.kind for end in ends if end.ran)
    once = ["clean", "cloud.ply", "deviations", "extract", "extract", "foot.stl", "fuse", "map", "map", "pictures"]
    twice = 2 * ["foot.ply", "report"]  # which name their scan
    assert ran == sorted(
        [
            *once,
            *twice,
            "heads",
            *4 * ["ingest"],
            "measure",
            "orient",
            "quality",
            "quality.json",
            "sizes.json",
            "surface",
        ]
    )


def test_equal_films_of_two_scans_are_computed_once(done: Any) -> None:
    add_scan(done, "S2")
    scans, ran = done.run()
    assert [scan.problem for scan in scans] == [None, None]
    named = {"P0001/S2/foot.ply", "P0001/S2/report"}  # they name their scan
    assert ran == {"P0001/S2/ingest-1", "P0001/S2/ingest-5", *named}


def test_interrupted_run_goes_on_from_what_is_complete(archive: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    original = engine_run.run_step

    def interrupted(store: Any, task: Any, *others: Any) -> Any:
        if task.step.kind == "fuse":
            raise KeyboardInterrupt
        return original(store, task, *others)

    with monkeypatch.context() as patch:
        patch.setattr(engine_run, "run_step", interrupted)
        with pytest.raises(KeyboardInterrupt):
            archive.run()
    [scan], ran = archive.run()
    assert scan.problem is None
    assert not any(name.startswith(("ingest", "extract", "map")) for name in ran)


def test_scan_without_calibration_is_refused(done: Any) -> None:
    done.workflow.write_text(done.workflow.read_text().replace("calibration: calibration.json\n", ""))
    [scan], _ = done.run()
    assert scan.problem == (
        f"{done.scan / 'scan.yaml'}: calibration: names no calibration, expected one here or in the workflow"
        f" ({done.results} still holds the results of an earlier run)"
    )


def test_own_calibration_of_a_scan_comes_before_the_workflows(
    done: Any, calibration: Callable[..., Calibration]
) -> None:
    (done.scan.parent / "own.json").write_text(calibration(1.01).model_dump_json())
    document = done.scan / "scan.yaml"
    document.write_text(document.read_text().replace("cameras:", "calibration: ../own.json\ncameras:"))
    assert done.plan()[1]["map-1"] == "input calibration changed"
    job = job_of_scan(done.scan, done.root / "calibration.json", done.root / "results", 1)
    assert "P0001/S1/map-1" not in [waiting.name for waiting in plan_job(job, reasons=True).waiting]


def test_calibration_without_a_camera_is_refused(done: Any, calibration: Callable[..., Calibration]) -> None:
    complete = calibration()
    path = done.root / "calibration.json"
    path.write_text(complete.model_copy(update={"cameras": [complete.camera(1)]}).model_dump_json())
    [scan], _ = done.run()
    earlier = f" ({done.results} still holds the results of an earlier run)"
    assert scan.problem == f"{path}: cameras: has no camera 5, expected one of 1{earlier}"


def test_one_scan_without_a_workflow(done: Any, tmp_path: Path) -> None:
    job = job_of_scan(done.scan, done.root / "calibration.json", tmp_path / "out", 2)
    [scan] = run_job(plan_job(job), Threads(2), lambda _: None)
    assert (scan.problem, scan.folder) == (None, tmp_path / "out/P0001/S1")
    assert (tmp_path / "out/P0001/S1/foot.stl").read_bytes() == (done.results / "foot.stl").read_bytes()
    with pytest.raises(RefusedInput, match="no such file"):
        read_yaml(tmp_path / "scan.yaml", Scan)


LAST = ("surface", "foot.stl", "quality", "quality.json", "measure", "sizes.json", "report")
"""The steps of a scan that nothing but each other takes results of."""


class UnreachableError(Exception):
    """An error class that only the library of a store knows."""


@pytest.fixture
def remote(done: Any) -> Iterator[Any]:
    """A finished archive whose store lies at a URL; what it delivered is gone, and what the last steps came to."""
    place = f"memory://{uuid.uuid4().hex}"
    memory, here = MemoryFileSystem(), done.root / "results/.footscan"
    for file in [*here.glob("blobs/*/*"), *here.glob("latest/*/*"), *here.glob("actions/*/*")]:
        content = file.read_bytes()
        if file.match("actions/*/*") and json.loads(content)["image"]["step"] in LAST:
            continue
        memory.pipe_file(f"{place}/{file.relative_to(here)}", content)
    shutil.rmtree(done.root / "results")
    done.workflow.write_text(f"{done.workflow.read_text()}cache: {place}\n")
    yield done
    memory.rm(place, recursive=True)


def fail(patch: pytest.MonkeyPatch, calls: range) -> list[str]:
    """Have the stores in memory fail at these of the calls to them; returns what failed, as it does."""
    counted = itertools.count()
    failed = []

    def failing(method: Callable[..., Any]) -> Callable[..., Any]:
        def asked(*args: Any, **options: Any) -> Any:
            if next(counted) in calls:
                failed.append(method.__name__)
                raise UnreachableError("Connect timeout on endpoint\n")
            return method(*args, **options)

        return asked

    for name in ("info", "cat_file", "pipe_file", "ls", "rm_file"):
        patch.setattr(MemoryFileSystem, name, failing(getattr(MemoryFileSystem, name)))
    return failed


def test_store_at_a_url_is_used_and_gives_the_same(remote: Any, finished: Path) -> None:
    [scan], ran = remote.run()
    assert (scan.problem, ran) == (None, set(LAST))
    for file in scan.digests:
        assert (remote.results / file).read_bytes() == (finished / "results/P0001/S1" / file).read_bytes()
    (remote.root / "results/.footscan/known.sqlite").unlink()
    assert remote.plan() == (21, {})
    assert remote.run()[1] == set()


@pytest.mark.parametrize("first", [0, 7, 29])
def test_plan_of_a_store_that_is_away_is_one_fault(
    remote: Any, monkeypatch: pytest.MonkeyPatch, first: int, caplog: pytest.LogCaptureFixture
) -> None:
    failed = fail(monkeypatch, range(first, 10**9))
    job = remote.job()
    with pytest.raises(Fault) as fault:
        plan_job(job, reasons=True)
    assert str(fault.value).startswith(f"{job.cache}/")
    assert str(fault.value).endswith("(UnreachableError: Connect timeout on endpoint)")
    assert (len(failed), caplog.messages) == (1, [])


@pytest.mark.parametrize("count", [1, 10**9], ids=["once", "from then on"])
def test_store_that_fails_costs_no_result(
    remote: Any, finished: Path, count: int, caplog: pytest.LogCaptureFixture
) -> None:
    """The store fails in any call: while planning, in a step, at the delivery, at the end of the run."""
    expected = re.compile(
        rf"{remote.job().cache}/\S+: cannot be (looked up|read|written|removed|listed) "
        r"\(UnreachableError: Connect timeout on endpoint\)"
    )
    complete: set[str] = set()
    problems = []
    for first in (3, 21, 30, 31, 45, 60, 90, 120, 160, 200):
        with pytest.MonkeyPatch.context() as patch:
            failed = fail(patch, range(first, first + count))
            try:
                ended = [scan.problem for scan in remote.run()[0]]
            except Fault as fault:
                ended = [str(fault)]
        problems += [problem for problem in ended if problem is not None]
        if count > 1 and failed:
            assert ended[-1] is not None
        # What was complete stays so, and nothing is taken for damaged.
        to_run = remote.plan()[1].keys()
        assert complete.isdisjoint(to_run)
        complete = {*LAST} - to_run
    assert len(problems) > 3
    assert [problem for problem in problems if not expected.fullmatch(problem)] == []
    assert [line for line in caplog.messages if not line.endswith("will not know of this run")] == []
    [scan], ran = remote.run()
    assert scan.problem is None
    assert complete.isdisjoint(ran)
    for file in scan.digests:
        assert (remote.results / file).read_bytes() == (finished / "results/P0001/S1" / file).read_bytes()


@pytest.mark.parametrize(
    ("cache", "problem"),
    [
        ("://x", "names no protocol, expected PROTOCOL://BUCKET/FOLDER or the like"),
        ("s3://", "names no place, expected PROTOCOL://BUCKET/FOLDER or the like"),
        ("memory://", "names no place, expected PROTOCOL://BUCKET/FOLDER or the like"),
        ("nosuch://x", "expected a place that fsspec reaches (Protocol not known: nosuch)"),
    ],
)
def test_cache_that_is_no_place_is_refused_before_anything(archive: Any, cache: str, problem: str) -> None:
    archive.workflow.write_text(f"{archive.workflow.read_text()}cache: '{cache}'\n")
    for may_be_empty in (False, True):  # as `run` and `cache stats` do
        with pytest.raises(RefusedInput) as refused:
            job_of_workflow(archive.workflow, may_be_empty=may_be_empty)
        assert str(refused.value) == f"{archive.workflow}: cache: {cache}: {problem}"
        assert refused.value.exit_status == 2
    assert not (archive.root / "results").exists()


def test_empty_parts_of_a_workflow(archive: Any) -> None:
    text = archive.workflow.read_text()
    archive.workflow.write_text(f"{text}parameters:\n  extraction:\n  outliers: {{gap_mm: 0.7}}\n")
    parameters = archive.job().parameters
    assert (parameters.extraction, parameters.outliers.gap_mm) == (ScanParameters().extraction, 0.7)
    archive.workflow.write_text(f"{text}parameters:\n")
    assert archive.job().parameters == ScanParameters()
    archive.workflow.write_text(f"{text}cache: ''\n")
    with pytest.raises(RefusedInput, match="cache: expected a folder or a URL, found ''"):
        archive.job()

"""Runs of a part of an archive, against a model of which steps must run."""

import datetime
import itertools
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest
import yaml

from pipelines.archive.job import Job, job_of_workflow
from pipelines.archive.planning import plan_job
from pipelines.archive.running import run_job
from pipelines.archive.selection import Selection, selection_of
from pipelines.archive.settings import changed_parameters
from pipelines.archive.summary import summary_of
from pipelines.cli.archive.run import run as run_command
from pipelines.cli.archive.selecting import Chosen
from pipelines.engine.pool import StepEnd, Threads
from pipelines.steps import surface
from schemas.base.errors import RefusedInput
from schemas.profile import first_day

INPUTS = {
    "ingest": [], "extract": ["ingest"], "map": ["extract", "ingest"], "heads": ["map"], "clean": ["map", "heads"],
    "fuse": ["clean"], "orient": ["fuse"], "surface": ["orient"], "measure": ["surface", "fuse", "clean", "heads"],
    "quality": ["heads", "clean", "fuse", "surface", "extract", "ingest"], "quality.json": ["quality", "measure"],
    "sizes.json": ["measure"],
    "cloud.ply": ["orient"], "foot.stl": ["surface"], "foot.ply": ["surface"],
    "pictures": ["clean", "map", "extract", "ingest"], "deviations": ["clean", "fuse", "surface"],
    "report": ["pictures", "orient", "surface", "deviations", "measure", "sizes.json", "quality.json"],
}  # fmt: skip
"""The steps of a scan without background and truth, and the steps whose results each takes, as docs/workflow.md has
them."""
OF_CAMERA = ("ingest", "extract", "map")
CAMERAS = (1, 5)
SCANS = 5
NIGHT: dict[str, Any] = {"only": ["P0001/*"], "until": "measure", "parameters": {"outliers": {"end_points": 2}}}

Name = tuple[str, str, int | None]
Options = dict[str, Any]

EACH: list[Options] = [
    {"only": ["P0002"]},
    {"only": ["*/S1", "P0003/S*"]},
    {"since": "2026-03-01"},
    {"until": "surface"},
    {"until": "quality.json"},
    {"force": ["fuse"]},
    {"force": ["extract-5", "report"]},
    {"set": ["surface.grid_steps=0.7"]},
    {"profile": "night"},
    {"fail_fast": True},
]


def _reaches(options: Options) -> bool:
    """Whether the steps that are forced come before the end of the run: others are refused."""
    until = options.get("until", NIGHT["until"] if "profile" in options else None)
    return all(name.partition("-")[0] in _part(until) for name in options.get("force", ()))


def pairs() -> list[Options]:
    both = [{**one, **other} for one, other in itertools.combinations(EACH, 2) if not one.keys() & other.keys()]
    return [options for options in both if _reaches(options)]


@dataclass
class Model:
    """An archive, as far as which steps have run."""

    scans: dict[str, datetime.date | None]
    known: dict[Name, set[str]] = field(default_factory=dict)
    """Settings for which each step has a result; a step after it has its result for the same settings."""

    def expected(self, options: Options) -> tuple[set[Name], set[Name]]:
        """The steps that a plan lists, and those that then run: steps whose results are made again stop the change."""
        night = NIGHT if options.get("profile") else {}
        only, until = options.get("only", night.get("only")), options.get("until", night.get("until"))
        settings = str([options.get("set"), night.get("parameters")])
        since = options.get("since")
        listed, run = set(), set()
        for scan, day in self.scans.items():
            if only and not any(fnmatch(scan, p if "/" in p else p + "/*") for p in only):
                continue
            if since and (day is None or day.isoformat() < since):
                continue
            for step in _part(until):
                own = {(scan, *name) for name in _names(step)}
                for _, kind, camera in own:
                    before = {(scan, *name) for above in INPUTS[kind] for name in _names(above, camera)}
                    name = (scan, kind, camera)
                    is_forced = bool({kind, f"{kind}-{camera}"} & set(options.get("force", ())))
                    is_known = self._has(name, settings, kind)
                    if is_forced or not is_known or before & listed:
                        listed.add(name)
                    if is_forced or not is_known:
                        run.add(name)
        return listed, run

    def note(self, options: Options, run: set[Name]) -> None:
        settings = str([options.get("set"), NIGHT["parameters"] if options.get("profile") else None])
        for name in run:
            self.known.setdefault(name, set()).add(_meant(name[1], settings))

    def _has(self, name: Name, settings: str, kind: str) -> bool:
        return _meant(kind, settings) in self.known.get(name, set())


def _meant(kind: str, settings: str) -> str:
    """Those of `settings` that change what a step takes."""
    changed = [one for one in ("surface.grid_steps", "end_points") if one in settings]
    after = {"surface.grid_steps": "surface", "end_points": "clean"}
    own = [one for one in changed if after[one] in {kind, *_before(kind)}]
    return str(changed if kind == "report" else own)  # the report lists all parameters


def _before(kind: str) -> set[str]:
    return {above for one in INPUTS[kind] for above in {one, *_before(one)}}


def _part(until: str | None) -> list[str]:
    kept = set(INPUTS) if until is None else {until, *_before(until)}
    return [kind for kind in INPUTS if kind in kept]


def _names(kind: str, camera: int | None = None) -> Iterator[tuple[str, int | None]]:
    if kind not in OF_CAMERA:
        yield kind, None
    for one in CAMERAS if kind in OF_CAMERA else ():
        if camera in (None, one):
            yield kind, one


def write_archive(root: Path, pristine: Path, write_scan: Callable[[Path, str, float], None], count: int) -> Model:
    """Scans of different feet; every third one has no date."""
    shutil.copytree(pristine, root, ignore=shutil.ignore_patterns("archive"))
    workflow = yaml.safe_load((root / "workflow.yaml").read_text())
    (root / "workflow.yaml").write_text(yaml.safe_dump({**workflow, "profiles": {"night": NIGHT}}))
    document = yaml.safe_load((pristine / "archive/P0001/S1/scan.yaml").read_text())
    model = Model({})
    for number in range(count):
        patient, scan = f"P{number // 2 + 1:04d}", f"S{number % 2 + 1}"
        day = None if number % 3 == 2 else datetime.date(2026, 2, 1) + datetime.timedelta(days=40 * (number % 4))
        own = {**document, "patient": patient, "scan": scan, **({} if day is None else {"date": day})}
        write_scan(root / "archive" / patient / scan, yaml.safe_dump(own), 1.0 + 0.2 * number / count)
        model.scans[f"{patient}/{scan}"] = day
    return model


def job_with(root: Path, options: Options) -> Job:
    job = job_of_workflow(root / "workflow.yaml", 2, options.get("profile"))
    given = selection_of(
        options.get("only", job.selection.only),
        options.get("since"),
        options.get("until", job.selection.until),
        options.get("force", ()),
    )
    parameters = changed_parameters(job.parameters, options.get("set", []))
    return replace(job, selection=given, parameters=parameters, fail_fast=options.get("fail_fast", False))


def planned_names(job: Job) -> set[Name]:
    return {(one.scan, one.kind, one.camera) for one in plan_job(job, reasons=True).waiting}


def run(job: Job) -> set[Name]:
    ends: list[StepEnd] = []
    for end in run_job(plan_job(job), Threads(2), ends.append):
        assert end.problem is None, end
    return {(end.step.scan, end.step.kind, end.step.camera) for end in ends if end.ran}


def check_every_option(root: Path, model: Model, every: list[Options]) -> None:
    for options in every:
        job = job_with(root, options)
        listed, expected = model.expected(options)
        assert planned_names(job) == listed, options
        assert run(job) == expected, options
        model.note(options, expected)
        if "force" not in options:
            assert planned_names(job) == set(), options


def test_every_option_alone_and_in_pairs(pristine: Path, write_scan: Any, tmp_path: Path) -> None:
    model = write_archive(tmp_path / "home", pristine, write_scan, SCANS)
    check_every_option(tmp_path / "home", model, [*EACH, *pairs(), {}])


@pytest.mark.slow
def test_every_option_in_an_archive_of_200(pristine: Path, write_scan: Any, tmp_path: Path) -> None:
    model = write_archive(tmp_path / "home", pristine, write_scan, 200)
    check_every_option(tmp_path / "home", model, [*EACH, *pairs(), {}])


@pytest.fixture
def many(pristine: Path, write_scan: Any, tmp_path: Path) -> Path:
    """An archive of four scans that was not run yet."""
    write_archive(tmp_path / "home", pristine, write_scan, 4)
    return tmp_path / "home"


def test_the_first_failure_ends_a_run(many: Path) -> None:
    film = many / "archive/P0001/S2/cam5.avi"
    film.write_bytes(film.read_bytes()[:2000])
    job = replace(job_with(many, {}), fail_fast=True, threads=1)
    ended: list[StepEnd] = []
    ends = list(run_job(plan_job(job), Threads(1), ended.append))
    assert [(end.scan, end.kind) for end in ends][-1] == ("P0001/S2", "refused")
    assert len(ends) < 4
    assert "cam5.avi" in str(ends[-1].problem)
    assert len({end.step.name for end in ended}) < plan_job(replace(job, fail_fast=False)).steps
    assert [end.scan for end in run_job(plan_job(job), Threads(1), ended.append)] == ["P0001/S2"]  # it is known
    kept_going = {
        end.scan: end.kind for end in run_job(plan_job(replace(job, fail_fast=False)), Threads(1), ended.append)
    }
    assert kept_going == {"P0001/S1": None, "P0001/S2": "refused", "P0002/S1": None, "P0002/S2": None}


def test_a_fault_ends_a_run_as_well(many: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is not recorded, as a refusal is: the scan that it struck is named all the same."""

    def full(*_: object) -> bytes:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(surface, "run", full)
    ends = list(run_job(plan_job(replace(job_with(many, {}), fail_fast=True, threads=1)), Threads(1), lambda _: None))
    assert [end.kind for end in ends] == ["fault"]
    assert str(ends[0].problem).startswith(f"{ends[0].scan}/surface: ")
    assert "No space left on device" in str(ends[0].problem)


def test_a_part_of_the_steps_delivers_where_nothing_was(many: Path) -> None:
    first = many / "results/P0001/S1"
    run(job_with(many, {"only": ["P0001/S1"], "until": "foot.stl"}))
    assert [file.name for file in first.iterdir()] == ["foot.stl"]
    run(job_with(many, {"only": ["P0001/S1"]}))
    before = {file: file.read_bytes() for file in first.iterdir()}
    assert len(before) == 7
    run(job_with(many, {"only": ["P0001/S1"], "until": "foot.stl", "set": ["surface.grid_steps=0.7"]}))
    assert {file: file.read_bytes() for file in first.iterdir()} == before


def test_a_summary_knows_what_steps_took(many: Path) -> None:
    job = job_with(many, {"only": ["P0001/S1"]})
    assert all(line.seconds is None for line in summary_of(plan_job(job, reasons=True)))
    run(job)
    every = summary_of(plan_job(job_with(many, {}), reasons=True))
    lines = {line.kind: line for line in every}
    assert set(lines) == set(INPUTS)
    assert (lines["extract"].steps, lines["report"].steps) == (6, 3)
    results = many / "results/P0001/S1"
    assert lines["report"].size == 3 * 2 * (results / "report.html").stat().st_size  # in the store and delivered
    films = sum((many / "archive" / scan / f"cam{n}.avi").stat().st_size for scan in SCANS_LEFT for n in CAMERAS)
    assert 0 <= lines["ingest"].size - films < 50_000  # and the manifests
    assert all(line.seconds is not None and line.seconds > 0 for line in every)


SCANS_LEFT = ("P0001/S2", "P0002/S1", "P0002/S2")


def test_frames_of_an_archive_that_cannot_be_written_lie_beside_the_store(
    many: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    access = os.access
    archive = (many / "archive").resolve()
    monkeypatch.setattr(os, "access", lambda path, mode: access(path, mode) and archive not in Path(path).parents)
    before = sorted(archive.rglob("*"))
    job = job_with(many, {"only": ["P0001"]})
    assert len(run(job)) == 2 * 21
    assert sorted(archive.rglob("*")) == before
    assert (many / "results/.footscan/frames/P0001/S1/frames.zarr/cam1/zarr.json").exists()
    assert run(job) == set()
    with_them = {file.name: file.read_bytes() for file in (many / "results/P0001/S1").iterdir()}
    monkeypatch.undo()
    assert len(run(job)) == 4  # ingest, whose results stay the same
    assert {file.name: file.read_bytes() for file in (many / "results/P0001/S1").iterdir()} == with_them


@pytest.mark.parametrize(
    ("selection", "problem"),
    [
        (Selection(only=("P0001", "P9")), "--only: no scan matches 'P9', expected patient/scan, for example P0001/S1"),
        (Selection(until="grow"), "--until: no such step, expected one of clean, cloud.ply"),
        (Selection(force=("fuse", "extract-7")), "--force: no such step, expected one of clean, cloud.ply"),
        (Selection(until="fuse", force=("surface",)), "--force: surface comes after fuse, at which --until ends"),
    ],
)
def test_what_is_not_there_is_refused(many: Path, selection: Selection, problem: str) -> None:
    with pytest.raises(RefusedInput) as refused:
        plan_job(replace(job_with(many, {}), selection=selection))
    assert str(refused.value).startswith(problem)


def test_a_scan_that_cannot_be_read_is_meant_by_its_folder(many: Path) -> None:
    (many / "archive/P0001/S2/scan.yaml").write_text("format: footscan.scan/1\n")
    assert len(plan_job(job_with(many, {"only": ["P0001"]})).refused) == 1
    assert plan_job(job_with(many, {"only": ["P0002"]})).refused == []
    assert len(plan_job(job_with(many, {"only": ["P0002"]})).left_out) == 1


def test_options_win_over_a_profile(many: Path) -> None:
    chosen = Chosen(until="surface", settings=["outliers.end_points=3"], profile="night")
    job = chosen.job(many / "workflow.yaml")
    assert job.selection == Selection(only=("P0001/*",), until="surface")
    assert job.parameters.outliers.end_points == 3
    assert Chosen(profile="night").job(many / "workflow.yaml").parameters.outliers.end_points == 2
    with pytest.raises(RefusedInput, match=r"profiles: no profile 'day', expected one of night"):
        Chosen(profile="day").job(many / "workflow.yaml")
    with pytest.raises(RefusedInput, match=r"--since: expected a date such as 2026-11-02, or days such as 7d"):
        Chosen(since="yesterday").job(many / "workflow.yaml")


def test_rows_of_scans_that_were_left_out_stay(many: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(many / "workflow.yaml") == 0
    whole = (many / "results/results.csv").read_text().splitlines()
    assert run_command(many / "workflow.yaml", only=["P0001/S2"], settings=["surface.grid_steps=0.7"]) == 0
    part = (many / "results/results.csv").read_text().splitlines()
    assert [new == old for new, old in zip(part, whole, strict=True)] == [True, True, False, True, True]
    assert run_command(many / "workflow.yaml", only=["P0001"], until="fuse") == 0
    assert (many / "results/results.csv").read_text().splitlines() == part
    assert "P0001/S1: done until fuse" in capsys.readouterr().out
    assert "P0002" in (many / "results/index.html").read_text()


def test_a_day_is_a_date_or_days_ago() -> None:
    assert first_day("0d", datetime.date(2026, 3, 1)) == datetime.date(2026, 3, 1)
    with pytest.raises(ValueError, match="expected a date such as 2026-11-02, or days such as 7d"):
        first_day("2026-13-01", datetime.date(2026, 3, 1))

"""`footscan forget`: nothing of a patient is left, nothing of another is touched."""

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipelines.cli.main import run_command
from pipelines.engine.files.places import LocalFiles
from pipelines.engine.store.erasure_notes import interrupted_erasures
from pipelines.engine.store.lease import lease
from pipelines.engine.store.store import open_store

Command = Callable[..., tuple[int, str, str]]


@pytest.fixture
def footscan(capsys: pytest.CaptureFixture[str]) -> Command:
    def run(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        status = run_command(list(map(str, arguments)))
        output = capsys.readouterr()
        return status, output.out, output.err

    return run


@pytest.fixture
def two(done: Any, footscan: Command) -> Any:
    """P0001, and P0002 with one film that is the same and one that is another."""
    other = done.root / "archive/P0002/S1"
    shutil.copytree(done.scan, other, ignore=shutil.ignore_patterns("frames.zarr"))
    document = (other / "scan.yaml").read_text().replace("P0001", "P0002")
    (other / "scan.yaml").write_text(document)
    film = bytearray((other / "cam5.avi").read_bytes())
    end = film.rfind(b"\xff\xd9")
    film[next(k for k in range(end - 200, 0, -1) if film[k - 1] < 0x80 and 0 < film[k] < 0x80)] ^= 1
    (other / "cam5.avi").write_bytes(film)
    for parameters in ("{outliers: {z_mm: [-1, 100]}}", "{}"):
        done.set_parameters(parameters)
        status, _, messages = footscan("run", done.workflow, "--log-json", done.root / "results/log.jsonl")
        assert status == 0, messages
    footscan("cache", "pin", "P0002/S1", "--workflow", done.workflow)
    return done


def all_bytes(root: Path) -> dict[str, bytes]:
    return {str(file.relative_to(root)): file.read_bytes() for file in sorted(root.rglob("*")) if file.is_file()}


def traces(root: Path, name: str) -> list[str]:
    content = all_bytes(root)
    return [file for file, data in content.items() if name in file or name.encode() in data]


def forget(two: Any, footscan: Command, *options: object) -> Any:
    status, out, messages = footscan("forget", "P0002", "--workflow", two.workflow, "--yes", "--json", *options)
    assert status == 0, messages
    return json.loads(out)


def test_nothing_of_a_patient_is_left_and_nothing_of_another_is_touched(two: Any, footscan: Command) -> None:
    assert len(traces(two.root, "P0002")) > 20
    mine = all_bytes(two.root / "archive/P0001") | all_bytes(two.results)
    with (two.root / "results/results.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["scan"] == "P0001/S1"]
    found = forget(two, footscan)
    assert (found["erased"], found["scans"], found["remains"]) == (True, ["P0002/S1"], [])
    assert traces(two.root, "P0002") == []
    assert not [path for path in two.root.rglob("*") if "P0002" in path.name]
    assert all_bytes(two.root / "archive/P0001") | all_bytes(two.results) == mine
    assert two.run()[1] == set()
    assert footscan("cache", "verify", two.workflow)[0] == 0
    with (two.root / "results/results.csv").open(newline="") as file:
        assert list(csv.DictReader(file)) == rows
    assert rows[0]["parameters_sha256"]
    assert "P0001" in (two.root / "results/index.html").read_text()
    assert "P0001" in (two.root / "results/log.jsonl").read_text()
    assert any("backups" in words for words in found["out_of_reach"])


def test_an_earlier_result_of_another_stays(two: Any, footscan: Command) -> None:
    forget(two, footscan)
    two.set_parameters("{outliers: {z_mm: [-1, 100]}}")
    assert two.run()[1] == set()


def test_a_dry_run_changes_nothing(two: Any, footscan: Command) -> None:
    before = all_bytes(two.root)
    found = forget(two, footscan, "--dry-run")
    assert found["store_files"] > 10
    assert all_bytes(two.root) == before


SUITE = """
format: footscan.suite/1
timed_passes: 0
sets:
  first: {scan: archive/P0001/S1, calibration: calibration.json}
  second: {scan: archive/P0002/S1, calibration: calibration.json}
"""


def test_nights_over_their_scans_and_logs_elsewhere(two: Any, footscan: Command) -> None:
    suite, log = two.root / "suite.yaml", two.root / "elsewhere.log"
    suite.write_text(SUITE)
    log.write_text("P0001/S1: done\nP0002/S1: done\n")
    status, _, messages = footscan("regress", suite, "--accept", "first night")
    assert status == 0, messages
    files = ("baseline.yaml", "baseline.steps.yaml", "nights/history.jsonl", "nights/good.steps.yaml")
    assert all("second" in (two.root / name).read_text() for name in files)
    more = ("--suite", suite, "--log", log)
    status, out, messages = footscan("forget", "P0002", "--workflow", two.workflow, "--yes", *more)
    assert status == 1, out
    assert "suite.yaml: sets second: still bears P0002" in messages
    assert log.read_text() == "P0001/S1: done\n"
    assert not any("second" in (two.root / name).read_text() for name in files)
    assert all("first" in (two.root / name).read_text() for name in files)
    suite.write_text("".join(line for line in SUITE.splitlines(keepends=True) if "second" not in line))
    status, _, messages = footscan("forget", "P0002", "--workflow", two.workflow, "--yes", *more)
    assert status == 0, messages
    assert traces(two.root, "P0002") == []
    assert footscan("regress", suite)[0] == 0


def test_one_scan_alone(two: Any, footscan: Command) -> None:
    second = two.root / "archive/P0002/S2"
    shutil.copytree(two.root / "archive/P0002/S1", second)
    document = (second / "scan.yaml").read_text().replace("scan: S1", "scan: S2")
    (second / "scan.yaml").write_text(document)
    assert footscan("run", two.workflow)[0] == 0
    found = forget(two, footscan, "--scan", "S2")
    assert (found["scans"], found["remains"]) == (["P0002/S2"], [])
    assert traces(two.root, "P0002/S2") == []
    assert (two.root / "archive/P0002/S1/scan.yaml").is_file()
    assert two.run()[1] == set()


@pytest.mark.parametrize("after", [0, 7, 40])
def test_what_was_cut_off_is_finished(
    two: Any, footscan: Command, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, after: int
) -> None:
    left = [after]

    class Killed(BaseException):
        pass

    remove = LocalFiles.remove

    def fail(self: Any, name: str) -> None:
        if left[0] == 0 and not name.startswith("runs/"):
            raise Killed
        left[0] -= not name.startswith("runs/")
        remove(self, name)

    with monkeypatch.context() as patch:
        patch.setattr(LocalFiles, "remove", fail)
        with pytest.raises(Killed):
            footscan("forget", "P0002", "--workflow", two.workflow, "--yes")
    assert interrupted_erasures(open_store(two.root / "results/.footscan")) == ["P0002"]
    assert footscan("run", two.workflow)[0] == 0
    assert "P0002: its erasure was interrupted" in caplog.text
    assert forget(two, footscan)["erased"]
    assert traces(two.root, "P0002") == []
    assert two.run()[1] == set()


def test_it_does_not_run_beside_a_run(two: Any, footscan: Command) -> None:
    before = all_bytes(two.root / "archive")
    with lease(open_store(two.root / "results/.footscan")):
        status, _, messages = footscan("forget", "P0002", "--workflow", two.workflow, "--yes")
    assert status == 1
    assert "is running since" in messages
    assert all_bytes(two.root / "archive") == before


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["..", "--yes"], "PATIENT"),
        (["P0001/S1", "--yes"], "PATIENT"),
        (["P0001", "--scan", "..", "--yes"], "--scan"),
        (["P0009", "--yes"], "P0009: is not known in archive, results or store"),
        (["P0001"], "--yes: is missing, expected it where nobody can be asked"),
    ],
)
def test_what_is_refused(done: Any, footscan: Command, arguments: list[str], expected: str) -> None:
    before = all_bytes(done.root)
    status, _, messages = footscan("forget", *arguments, "--workflow", done.workflow)
    assert (status, len(messages.splitlines())) == (2, 1)
    assert expected in messages
    assert all_bytes(done.root) == before


def test_a_folder_that_is_a_link_out_is_refused(done: Any, footscan: Command, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "letter.txt").write_text("mine")
    (done.root / "results/P0007").symlink_to(elsewhere)
    status, _, messages = footscan("forget", "P0007", "--workflow", done.workflow, "--yes")
    assert status == 2
    assert "is a link" in messages
    assert (elsewhere / "letter.txt").read_text() == "mine"


def test_what_remains_is_told(two: Any, footscan: Command) -> None:
    shutil.copy(two.root / "archive/P0002/S1/cam5.avi", two.root / "archive/copy.avi")
    (two.root / "archive/notes.txt").write_text("the left foot of P0002 hurts")
    status, _, messages = footscan("forget", "P0002", "--workflow", two.workflow, "--yes")
    assert status == 1
    assert f"{two.root / 'archive/copy.avi'}: still bears P0002" in messages
    assert f"{two.root / 'archive/notes.txt'}: still bears P0002" in messages
    for name in ("copy.avi", "notes.txt"):
        (two.root / "archive" / name).unlink()
    assert forget(two, footscan)["erased"]

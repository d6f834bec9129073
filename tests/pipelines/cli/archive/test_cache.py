"""`footscan cache`: what it prints, deletes and refuses."""

import json
import logging
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipelines.cli.main import run_command
from pipelines.engine.store.lease import lease
from pipelines.engine.store.store import open_store
from pipelines.engine.trace import read_actions

Command = Callable[..., tuple[int, str, list[str]]]

OTHER = "{outliers: {z_mm: [-1, 100]}}"


@pytest.fixture
def cache(capsys: pytest.CaptureFixture[str]) -> Command:
    """Exit status, standard output and the lines of standard error of `footscan cache ARGUMENTS`."""

    def run(*arguments: object) -> tuple[int, str, list[str]]:
        capsys.readouterr()
        status = run_command(["cache", *map(str, arguments)])
        output = capsys.readouterr()
        return status, output.out, output.err.splitlines()

    return run


def as_json(done: tuple[int, str, list[str]], status: int = 0) -> Any:
    assert done[0] == status
    return json.loads(done[1])


def place(archive: Any) -> Path:
    return Path(archive.root / "results/.footscan")


def size(archive: Any) -> int:
    folders = (place(archive) / folder for folder in ("blobs", "actions", "latest", "pins"))
    return sum(file.stat().st_size for folder in folders for file in folder.rglob("*") if file.is_file())


def test_stats(done: Any, cache: Command) -> None:
    found = as_json(cache("stats", done.workflow, "--json"))
    assert (found["store"], found["actions"], found["pins"]) == (str(place(done)), 21, [])
    assert found["bytes"] == size(done)
    assert found["blobs"] == len(list((place(done) / "blobs").glob("*/*")))
    assert found["kinds"]["extract"]["actions"] == found["kinds"]["extract"]["results"] == 2
    assert (found["gc"]["files"], found["gc"]["young_files"]) == (0, 0)
    assert as_json(cache("stats", "--cache", place(done), "--json")) == found
    status, printed, messages = cache("stats", done.workflow)
    assert (status, messages) == (0, [])
    assert f"{found['bytes'] / 1e6:.2f}" in printed
    assert printed.splitlines()[-1] == "gc would free 0 files, 0.00 MB"


def test_gc_lists_and_deletes_only_when_told(done: Any, cache: Command) -> None:
    done.set_parameters(OTHER)
    _, ran = done.run()
    assert "clean" in ran
    before = size(done)
    assert as_json(cache("gc", done.workflow, "--json"))["files"] == 0  # a day has not gone by
    listed = as_json(cache("gc", done.workflow, "--older-than", 0, "--json"))
    assert listed["files"] > 0
    assert (listed["deleted"], size(done)) == (0, before)
    status, printed, _ = cache("gc", done.workflow, "--older-than", 0)
    assert (status, printed.splitlines()[-1]) == (0, "nothing was deleted: --delete does it")
    assert f"to go: {listed['files']} files, {listed['bytes'] / 1e6:.2f} MB" in printed
    deleted = as_json(cache("gc", done.workflow, "--older-than", 0, "--delete", "--json"))
    assert (deleted["deleted"], deleted["deleted_bytes"]) == (listed["files"], listed["bytes"])
    assert size(done) == before - listed["bytes"]
    assert done.run()[1] == set()
    assert cache("verify", done.workflow)[0] == 0


def test_gc_waits_for_runs(done: Any, cache: Command) -> None:
    done.set_parameters(OTHER)
    done.run()
    before = size(done)
    with lease(open_store(place(done))):
        status, printed, messages = cache("gc", done.workflow, "--older-than", 0, "--delete")
        assert (status, size(done)) == (1, before)
        assert "deleted: 0 files" in printed
        assert len(messages) == 1
        assert "is running since" in messages[0]
        [run] = as_json(cache("gc", done.workflow, "--json"))["runs"]
        assert run["process"] > 0
    assert cache("gc", done.workflow, "--older-than", 0, "--delete")[0] == 0
    assert size(done) < before


def test_a_lease_from_the_future_is_said_and_taken_over(done: Any, cache: Command) -> None:
    done.set_parameters(OTHER)
    done.run()
    ahead = time.time() + 365 * 86400.0
    (place(done) / "runs").mkdir(exist_ok=True)
    (place(done) / "runs/attic-7-ab.json").write_text(
        json.dumps({"host": "attic", "process": 7, "started": ahead, "heartbeat": ahead})
    )
    status, _, messages = cache("gc", done.workflow, "--older-than", 0, "--delete")
    assert status == 1
    assert "process 7 on attic is dated in the future" in messages[0]
    assert "--take-over" in messages[0]
    [run] = as_json(cache("gc", done.workflow, "--json"))["runs"]
    assert (run["host"], run["ahead"]) == ("attic", True)
    found = as_json(cache("gc", done.workflow, "--older-than", 0, "--delete", "--take-over", "--json"))
    assert [run["host"] for run in found["taken_over"]] == ["attic"]
    assert found["deleted"] > 0
    assert not (place(done) / "runs/attic-7-ab.json").exists()


def test_gc_frees_what_only_a_vanished_scan_needed(done: Any, cache: Command) -> None:
    before = size(done)
    other = done.root / "archive/P0002/S1"
    shutil.copytree(done.scan, other)
    document = (other / "scan.yaml").read_text().replace("P0001", "P0002")
    (other / "scan.yaml").write_text(document.replace("step_mm: 10.0", "step_mm: 9.0"))
    done.run()
    assert size(done) > before
    assert as_json(cache("gc", done.workflow, "--older-than", 0, "--json"))["files"] == 0
    shutil.rmtree(other)
    freed = as_json(cache("gc", done.workflow, "--older-than", 0, "--delete", "--json"))
    assert freed["vanished"] == ["P0002/S1"]
    assert freed["deleted"] > 0
    steps = {latest.step for latest in read_actions(open_store(place(done))).latest}
    assert {step.rpartition("/")[0] for step in steps} == {"P0001/S1"}
    assert abs(size(done) - before) < 4096  # the table of digests' own size apart
    assert done.run()[1] == set()


def test_an_archive_that_is_not_mounted_has_lost_no_scan(done: Any, cache: Command) -> None:
    before = size(done)
    done.run()
    (done.root / "archive").rename(done.root / "unmounted")
    (done.root / "archive").mkdir()
    found = as_json(cache("gc", done.workflow, "--older-than", 0, "--delete", "--json"))
    assert (found["vanished"], found["deleted"], size(done)) == ([], 0, before)


def test_going_back_keeps_what_lies_in_the_results(done: Any, cache: Command) -> None:
    done.set_parameters(OTHER)
    done.run()
    done.set_parameters("{}")
    assert done.run()[1] == set()
    assert as_json(cache("gc", done.workflow, "--older-than", 0, "--delete", "--json"))["deleted"] == 0
    assert done.run()[1] == set()
    # Without the workflow the files in the results tell most of it, but not which of equal results is the present one.
    assert as_json(cache("gc", "--cache", place(done), "--older-than", 0, "--delete", "--json"))["deleted"] <= 1


@pytest.mark.parametrize("name", ["P0001/S1", "archive/P0001/S1"])
def test_pin_and_unpin(done: Any, cache: Command, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(done.root)
    assert as_json(cache("pin", name, "--json")) == {"store": str(place(done)), "scan": "P0001/S1", "steps": 21}
    assert (place(done) / "pins/P0001/S1.json").is_file()
    assert as_json(cache("stats", "--json"))["pins"] == ["P0001/S1"]
    done.set_parameters(OTHER)
    done.run()
    assert as_json(cache("gc", "--older-than", 0, "--json"))["files"] == 0
    assert cache("unpin", name)[1] == "P0001/S1: kept no longer than other results\n"
    assert as_json(cache("gc", "--older-than", 0, "--json"))["files"] > 0


def test_verify(done: Any, cache: Command, caplog: pytest.LogCaptureFixture) -> None:
    sound = as_json(cache("verify", done.workflow, "--json"))
    assert sound["damaged"] == []
    blob = next((place(done) / "blobs").glob("*/*"))
    blob.write_bytes(b"x" + blob.read_bytes())
    with caplog.at_level(logging.WARNING):
        found = as_json(cache("verify", done.workflow, "--json"), status=1)
    assert (found["files"], found["damaged"]) == (sound["files"], [str(blob)])
    assert caplog.messages == [f"{blob}: damaged, will be made again"]
    assert cache("verify", done.workflow)[:2] == (0, f"{place(done)}: {sound['files'] - 1} files read, 0 damaged\n")


def test_verify_does_actions_again(done: Any, cache: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    done.run()  # moved, so the films are looked at anew
    found = as_json(cache("verify", done.workflow, "--recompute", "100%", "--json"))
    assert (found["recomputed"], found["differences"], found["problems"]) == (21, [], [])
    assert as_json(cache("verify", done.workflow, "--recompute", "4%", "--json"))["recomputed"] == 1
    assert cache("verify", done.workflow, "--recompute", "4%")[1].endswith(
        "1 action done again, 0 came to something else\n"
    )
    from pipelines.steps import cloud_ply, measure

    monkeypatch.setattr(measure, "run", lambda *_: b"other")
    monkeypatch.setattr(cloud_ply, "run", lambda *_: 1 // 0)
    status, printed, messages = cache("verify", done.workflow, "--recompute", "100%", "--seed", 3)
    assert (status, printed.splitlines()[-1]) == (1, "21 actions done again, 1 came to something else")
    recorded = open_store(place(done)).latest("P0001/S1/measure")
    assert recorded is not None
    row = open_store(place(done)).row(recorded.key)
    assert row is not None
    other = "d9298a10d1b0735837dc4bd85dac641b0f3cef27a47e5d53a54f2f3f5b2fcffa"  # sha256sum of "other"
    assert messages == [
        f"footscan: P0001/S1/measure: NOT REPRODUCED: recorded {row.digest}, now {other}",
        "footscan: P0001/S1: ZeroDivisionError: integer division or modulo by zero",
    ]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["stats", "WORKFLOW", "--cache", "x"], "a workflow and --cache exclude each other, expected one of them"),
        (["stats", "--cache", "nowhere"], "nowhere: no such folder, expected the store of a run"),
        (["gc", "nowhere.yaml"], "no such file"),
        (["gc", "WORKFLOW", "--older-than", "-1"], "--older-than"),
        (
            ["verify", "WORKFLOW", "--recompute", "some"],
            "--recompute: expected a share above 0% and at most 100%, such as 5%",
        ),
        (
            ["verify", "WORKFLOW", "--recompute", "0.05"],
            "--recompute: expected a share above 0% and at most 100%, such as 5%",
        ),
        (
            ["verify", "WORKFLOW", "--recompute", "0%"],
            "--recompute: expected a share above 0% and at most 100%, such as 5%",
        ),
        (
            ["verify", "WORKFLOW", "--recompute", "101%"],
            "--recompute: expected a share above 0% and at most 100%, such as 5%",
        ),
        (["verify", "--cache", "CACHE", "--recompute", "4%"], "--recompute: needs the workflow"),
        (["pin", "P0001/S2", "--cache", "CACHE"], "P0001/S2: has no results in"),
        (["unpin", "P0001/S1", "--cache", "CACHE"], "P0001/S1: is not pinned, expected a pinned scan: there is none"),
        (["pin", "../S1", "--cache", "CACHE"], "scan: expected 1 to 64 letters"),
        (["stats", "--cache", "nosuch://x"], "expected a place that fsspec reaches"),
    ],
)
def test_wrong_use_is_one_line(finished: Path, cache: Command, arguments: list[str], expected: str) -> None:
    paths = {"WORKFLOW": str(finished / "workflow.yaml"), "CACHE": str(finished / "results/.footscan")}
    status, printed, lines = cache(*(paths.get(argument, argument) for argument in arguments))
    assert (status, printed, len(lines)) == (2, "", 1)
    assert expected in lines[0]


def test_others_who_can_write_are_warned_about(done: Any, cache: Command, caplog: pytest.LogCaptureFixture) -> None:
    place(done).chmod(0o777)
    with caplog.at_level(logging.WARNING):
        assert cache("stats", "--cache", place(done))[0] == 0
    assert f"{place(done)}: other users can write to it" in caplog.text

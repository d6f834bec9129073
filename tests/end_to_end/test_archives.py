"""Archives: scans that arrive, runs that are interrupted, processes for threads, logs and tables for programs."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import pytest
from pyarrow import parquet

Footscan = Callable[..., CompletedProcess[str]]
Mistake = Callable[[CompletedProcess[str]], str]
CAMERAS = (1, 5)
STEPS = 21
"""Ingest, extract and map of 2 cameras; fuse, clean, orient, surface, measure, quality, 2 exports, report."""
PATIENCE_S = 300.0
"""No test waits as long, unless it fails."""


@pytest.fixture
def bench(pristine: Path, tmp_path: Path) -> Path:
    """A copy of the workflow and its scan, before their first run."""
    return Path(shutil.copytree(pristine, tmp_path / "bench"))


def copy_scan(source: Path, to: Path, *missing: str) -> None:
    """A scan with the same films, named for its folder."""
    shutil.copytree(source, to, ignore=shutil.ignore_patterns(*missing))
    document = to / "scan.yaml"
    document.write_text(document.read_text().replace("scan: S1", f"scan: {to.name}"))


def table(bench: Path) -> dict[str, dict[str, Any]]:
    """Rows of the table of all results, by the name of their scan's folder."""
    rows = parquet.read_table(bench / "results/results.parquet").to_pylist()
    return {Path(row["scan"]).name: row for row in rows}


def results(bench: Path, scan: str = "S1") -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in sorted((bench / "results/P0001" / scan).iterdir())}


def wait_for(moment: Callable[[], object], process: subprocess.Popen[str]) -> None:
    """Wait for something that a process brings about."""
    deadline = time.monotonic() + PATIENCE_S
    while not moment():
        assert process.poll() is None, f"ended before its time:\n{process.communicate()[1]}"
        assert time.monotonic() < deadline, "it does not come about"
        time.sleep(0.02)


@contextmanager
def started(bench: Path, *options: object) -> Iterator[subprocess.Popen[str]]:
    """`footscan run OPTIONS` on a bench as a person at a terminal starts it; killed at the end, if it still runs."""
    footscan = Path(sys.executable).with_name("footscan")
    # In the background of a shell Ctrl-C is ignored, and by all that is started there; at a terminal it is not.
    heeding = (
        "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); os.execv(sys.argv[1], sys.argv[1:])"
    )
    command = [str(footscan), "run", str(bench / "workflow.yaml"), *map(str, options)]
    line = [sys.executable, "-c", heeding, *command]
    with (bench / "stdout").open("w") as out:
        process = subprocess.Popen(line, stdout=out, stderr=subprocess.PIPE, text=True, start_new_session=True)
        try:
            yield process
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.communicate()


def press_ctrl_c(process: subprocess.Popen[str]) -> list[str]:
    """A terminal sends SIGINT to all processes of the command; what it says on standard error before its last line."""
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130, said
    assert "Traceback" not in said
    *others, last = said.splitlines()
    assert last == "footscan: interrupted; what is complete is kept"
    return others


@contextmanager
def being_copied(source: Path, target: Path) -> Iterator[None]:
    """A film of which more arrives all the time, and the last byte at the end."""
    content, done = source.read_bytes(), threading.Event()

    def copy() -> None:
        with target.open("wb") as film:
            for byte in range(len(content) - 1):
                film.write(content[byte : byte + 1])
                film.flush()
                if done.wait(0.1):
                    film.write(content[byte + 1 :])
                    return

    copying = threading.Thread(target=copy)
    copying.start()
    try:
        yield
    finally:
        done.set()
        copying.join()


def events(log: Path, kind: str) -> list[dict[str, Any]]:
    """Of a log that may still be written."""
    text = log.read_text() if log.exists() else ""
    whole = text[: text.rfind("\n") + 1].splitlines()
    return [event for event in map(json.loads, whole) if event["event"] == kind]


def test_scans_are_run_as_they_arrive(bench: Path) -> None:
    source, archive, log = bench / "arriving/S1", bench / "archive/P0001", bench / "log.jsonl"
    source.parent.mkdir()
    shutil.move(archive / "S1", source)  # the archive is there, and empty
    with started(bench, "--watch", "--log-json", log) as process:
        wait_for(log.exists, process)
        copy_scan(source, archive / "S2", "cam5.avi")
        with being_copied(source / "cam5.avi", archive / "S2/cam5.avi"):
            shutil.copytree(source, archive / "S1")
            wait_for(lambda: events(log, "scan"), process)
            assert [(end["scan"], end["status"]) for end in events(log, "scan")] == [("P0001/S1", "done")]
            assert not (archive / "S2/frames.zarr").exists()
            assert not (bench / "results/P0001/S2").exists()
        wait_for(lambda: len(events(log, "scan")) == 2, process)
        before = results(bench)
        shutil.copytree(source, archive / "S0")  # and still named S1
        wait_for(lambda: len(events(log, "scan")) == 3 and "S0" in table(bench), process)
        said = press_ctrl_c(process)
    problem = f"{archive / 'S0/scan.yaml'}: P0001/S1 is also in {archive / 'S1'}, expected each scan once"
    assert (said[0], said[-1]) == (f"watching {bench / 'archive'}", f"footscan: {problem}")
    ended = [(end["scan"], end["status"]) for end in events(log, "scan")]
    assert ended == [("P0001/S1", "done"), ("P0001/S2", "done"), (str(archive / "S0"), "refused")]
    assert results(bench) == before
    assert {name: row["status"] for name, row in table(bench).items()} == {"S1": "done", "S2": "done", "S0": "refused"}
    ran = [event["step"] for event in events(log, "step") if event["scan"] == "P0001/S2" and event["ran"]]
    assert sorted(ran) == [
        "foot.ply",
        "ingest",
        "ingest",
        "report",
    ]  # its films are those of S1, whose frames gave the rest
    assert results(bench)["foot.stl"] == results(bench, "S2")["foot.stl"]


def test_ctrl_c_ends_a_run_and_the_next_goes_on(footscan: Footscan, bench: Path) -> None:
    log = bench / "log.jsonl"
    with started(bench, "--threads", 1, "--log-json", log) as process:
        wait_for(lambda: len(events(log, "step")) >= len(CAMERAS), process)
        said = press_ctrl_c(process)
    assert said[0] == f"{STEPS} of {STEPS} steps to run"
    assert not (bench / "results/P0001").exists()
    complete = len(events(log, "step"))
    assert complete < STEPS
    done = footscan("run", bench / "workflow.yaml", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["ran"] <= STEPS - complete


def test_ctrl_c_ends_processes_and_all_that_they_say(footscan: Footscan, bench: Path) -> None:
    log = bench / "log.jsonl"
    with started(bench, "--workers", 2, "--dashboard", "--log-json", log) as process:
        wait_for(lambda: len(events(log, "step")) >= len(CAMERAS), process)
        planned, dashboard = press_ctrl_c(process)
    assert planned == f"{STEPS} of {STEPS} steps to run"
    assert dashboard.startswith("dashboard: http://127.0.0.1:")
    assert not (bench / "results/P0001").exists()
    done = footscan("run", bench / "workflow.yaml", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["ran"] <= STEPS - len(events(log, "step"))


@pytest.mark.slow
def test_processes_give_the_bytes_of_threads(command: Footscan, footscan: Footscan, bench: Path) -> None:
    workflow = bench / "workflow.yaml"
    done = command("run", workflow, "--workers", 2)
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"P0001/S1: {bench / 'results/P0001/S1'}\n"
    said = [line for line in done.stderr.splitlines() if not line.startswith("P0001/S1: ")]  # its warnings
    assert said == [f"{STEPS} of {STEPS} steps to run"]  # and no status page
    by_processes = results(bench)
    again = command("run", workflow, "--workers", 2)  # nothing is to run: no processes are started for it
    assert (again.returncode, again.stderr.splitlines()[0]) == (0, f"0 of {STEPS} steps to run")
    shutil.rmtree(bench / "results")
    shutil.rmtree(bench / "archive/P0001/S1/frames.zarr")
    done = footscan("run", workflow, "--threads", 2)
    assert (done.returncode, done.stderr.splitlines()[0]) == (0, f"{STEPS} of {STEPS} steps to run")
    assert results(bench) == by_processes


def test_log_and_table_tell_of_each_scan(footscan: Footscan, bench: Path) -> None:
    """One scan is sound, of one a film was cut off, and one lacks a film."""
    archive, log = bench / "archive/P0001", bench / "log.jsonl"
    for scan in ("S2", "S3"):
        copy_scan(archive / "S1", archive / scan)
    film = archive / "S2/cam1.avi"
    film.write_bytes(film.read_bytes()[:-5000])
    (archive / "S3/cam5.avi").unlink()
    before = time.time()
    done = footscan("run", bench / "workflow.yaml", "--log-json", log)
    assert done.returncode == 1
    assert done.stdout == f"P0001/S1: {bench / 'results/P0001/S1'}\n"
    problems = {line for line in done.stderr.splitlines() if line.startswith("footscan: ")}
    assert len(problems) == 2

    lines = log.read_text().splitlines()
    assert all(isinstance(json.loads(line), dict) for line in lines)
    assert len(lines) == len(events(log, "step")) + len(events(log, "scan"))
    steps, scans = events(log, "step"), events(log, "scan")
    facts = {"event", "time", "scan", "step", "camera", "ran", "seconds", "problem", "otherwise"}
    assert all(set(step) == facts for step in steps)
    assert all(before <= event["time"] <= time.time() for event in (*steps, *scans))
    cameras = sorted(step["camera"] for step in steps if step["scan"] == "P0001/S1" and step["camera"] is not None)
    assert cameras == sorted(3 * CAMERAS)
    assert all(set(scan) == {"event", "time", "scan", "status", "known", "results", "problem"} for scan in scans)
    assert {scan["scan"] for scan in scans} == {"P0001/S1", "P0001/S2", "P0001/S3"}
    ended = {Path(scan["scan"]).name: scan for scan in scans}
    assert {name: scan["status"] for name, scan in ended.items()} == {"S1": "done", "S2": "refused", "S3": "refused"}
    assert (ended["S1"]["results"], ended["S1"]["problem"]) == (str(bench / "results/P0001/S1"), None)
    assert problems == {f"footscan: {ended[name]['problem']}" for name in ("S2", "S3")}

    rows = table(bench)
    assert {row["scan"] for row in rows.values()} == {"P0001/S1", "P0001/S2", "P0001/S3"}
    assert {name: row["status"] for name, row in rows.items()} == {"S1": "done", "S2": "refused", "S3": "refused"}
    measures = json.loads(results(bench)["measures.json"])["measures"]
    assert rows["S1"]["foot_length_mm"] == measures["foot_length"]["value"]
    assert rows["S2"]["foot_length_mm"] is None
    assert str(film) in rows["S2"]["problem"]


def test_a_table_that_cannot_be_written_hides_no_scan(footscan: Footscan, bench: Path) -> None:
    archive = bench / "archive/P0001"
    copy_scan(archive / "S1", archive / "S2", "cam5.avi")
    (bench / "results/results.parquet").mkdir(parents=True)
    done = footscan("run", bench / "workflow.yaml")
    assert (done.returncode, done.stdout) == (3, f"P0001/S1: {bench / 'results/P0001/S1'}\n")
    scan, table = (line for line in done.stderr.splitlines() if line.startswith("footscan: "))
    assert scan == f"footscan: {archive / 'S2/cam5.avi'}: no such film"
    assert table == f"footscan: {bench / 'results/results.parquet'}: cannot be written (Is a directory)"


def test_a_cluster_without_a_name_is_refused(footscan: Footscan, bench: Path, mistake: Mistake) -> None:
    done = footscan("run", bench / "workflow.yaml", "--cluster", "")
    assert done.returncode == 2
    assert mistake(done).startswith("--cluster: expected the address of a Dask scheduler")


def test_a_cluster_that_nobody_runs_is_refused(command: Footscan, bench: Path, mistake: Mistake) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))  # but does not listen: nobody answers, and nobody else takes it meanwhile
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        done = command("run", bench / "workflow.yaml", "--cluster", address)
    assert done.returncode == 2
    assert mistake(done).startswith(f"--cluster {address}: no Dask scheduler answers (")
    assert not list((bench / "archive").rglob("frames.zarr"))

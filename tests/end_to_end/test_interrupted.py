"""A run that is killed at any moment leaves nothing that misleads the next one."""

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest

Footscan = Callable[..., CompletedProcess[str]]
Results = Callable[[Path], dict[str, bytes]]


def steps_done(bench: Path) -> int:
    return sum(1 for _ in (bench / "results/.footscan/actions").rglob("[!.]*.json"))


@pytest.mark.slow
def test_two_runs_from_nothing_give_the_same_bytes(
    command: Footscan, fresh: Path, measured: Path, results: Results
) -> None:
    done = command("run", fresh / "workflow.yaml", "--threads", 1)
    assert done.returncode == 0
    assert results(fresh) == results(measured)


def test_after_a_kill_the_next_run_ends_well(
    footscan: Footscan, command: Footscan, recorded: Path, measured: Path, tmp_path: Path, results: Results
) -> None:
    """One run, killed while films become frames, again amid the extraction, and again once the cloud is there."""
    bench = tmp_path / "bench"
    shutil.copytree(recorded, bench)
    installed = str(Path(sys.executable).with_name("footscan"))
    done_before = 0
    frames = bench / "archive/P0001/small/frames.zarr"
    for moment in (frames.exists, lambda: steps_done(bench) >= 9, lambda: steps_done(bench) >= 27):
        process = subprocess.Popen(
            [installed, "run", str(bench / "workflow.yaml")], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        deadline = time.monotonic() + 60
        while not moment() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.002)
        process.kill()
        process.communicate()
        assert process.returncode == -9, "it was over before it could be killed"
        assert not list((bench / "results").glob("P0001/*/*.*"))  # no results of a run that did not end
        assert steps_done(bench) >= done_before
        done_before = steps_done(bench)
    assert 27 <= done_before < 35
    planned = json.loads(footscan("plan", bench / "workflow.yaml", "--json").stdout)
    assert planned["hits"] >= done_before
    done = command("run", bench / "workflow.yaml")
    assert done.returncode == 0, done.stderr
    assert results(bench) == results(measured)
    assert not [file for file in bench.rglob("*.partial*") if file.suffix != ".partial"]  # no half array of frames
    assert not list((bench / "archive").rglob(".*"))
    shutil.rmtree(bench)

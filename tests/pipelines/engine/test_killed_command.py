"""The command itself, killed at random moments: the next run goes on from what is complete.

FOOTSCAN_FUZZ=10 pytest tests/pipelines/engine/test_killed_command.py      on demand alone, for each takes seconds
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from random import Random
from typing import Any

import pytest

from pipelines.engine.files.digest import sha256

KILLS = int(os.environ.get("FOOTSCAN_FUZZ", "0"))
FIRST = int(os.environ.get("FOOTSCAN_FUZZ_FIRST", "0"))
RUN = "import sys; from pipelines.cli.main import run_command; sys.exit(run_command(['run', sys.argv[1]]))"


@pytest.mark.skipif(not KILLS, reason="on demand: FOOTSCAN_FUZZ=10")
@pytest.mark.parametrize("number", range(FIRST, FIRST + KILLS))
def test_killed_command_is_gone_on_with(number: int, archive: Any, finished: Path) -> None:
    random = Random(f"command {number}")
    steps, _ = archive.plan()
    process = subprocess.Popen([sys.executable, "-c", RUN, archive.workflow], stderr=subprocess.DEVNULL)
    moment = random.randrange(steps)
    while process.poll() is None and len(complete_steps(archive.root)) < moment:
        time.sleep(0.001)
    time.sleep(random.uniform(0, 0.1))
    process.kill()
    process.wait()
    complete = complete_steps(archive.root)
    assert len(complete) >= moment
    scans, ran = archive.run()
    assert [(scan.scan, scan.problem) for scan in scans] == [("P0001/S1", None)]
    assert not ran & complete
    assert results(archive.root) == results(finished)


def complete_steps(root: Path) -> set[str]:
    """Names, within the scan, of the steps with a row and its result."""
    store = root / "results" / ".footscan"
    found = set()
    for file in (store / "latest").rglob("[!.]*.json"):
        latest = json.loads(file.read_bytes())
        row = json.loads((store / "actions" / latest["key"][:2] / f"{latest['key']}.json").read_bytes())
        blob = store / "blobs" / row["digest"][:2] / row["digest"]
        assert sha256(blob.read_bytes()) == row["digest"]
        found.add(latest["step"].removeprefix("P0001/S1/"))
    return found


def results(root: Path) -> dict[str, bytes]:
    """The delivered files, and the results and actions in the store."""
    store = root / "results" / ".footscan"
    files = [file for kind in (root / "results/P0001", store / "blobs", store / "actions") for file in kind.rglob("*")]
    return {
        file.relative_to(root).as_posix(): file.read_bytes()
        for file in files
        if file.is_file() and not file.name.endswith(".partial")
    }

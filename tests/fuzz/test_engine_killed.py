"""A run that is killed at any moment costs what it was at, and nothing else.

    FOOTSCAN_FUZZ=100 pytest tests/fuzz/test_engine_killed.py      100 killed runs instead of a few
    FOOTSCAN_FUZZ_FIRST=41 FOOTSCAN_FUZZ=1 ...                     case 41 again

A case's moments follow from its number, but for the machine's pace.
"""

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from random import Random

import made_up_graph
import pytest
from made_up_graph import complete_steps, prepare, run_graph, sound_files, store_files, times_run

ASKED = os.environ.get("FOOTSCAN_FUZZ")
FIRST = int(os.environ.get("FOOTSCAN_FUZZ_FIRST", "0"))
KILLS, PAIRS = (3, 1) if ASKED is None else (int(ASKED), 1 + int(ASKED) // 5)

PAUSE_S = 0.02
"""More than a step takes with all that is written for it."""


@dataclass(frozen=True)
class Undisturbed:
    """A run that nothing happened to."""

    results: dict[str, str]
    files: dict[str, bytes]
    """See `content`."""


class Running:
    """A process that is about to run the graph."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        command = [sys.executable, "-W", "error", made_up_graph.__file__, str(folder)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._input, self._output = self._process.stdin, self._process.stdout
        assert self._output.readline() == "ready\n"

    def go(self) -> "Running":
        self._input.write("go\n")
        self._input.flush()
        return self

    def kill_at(self, begun: int, then_s: float) -> None:
        """Kills it once so many steps have begun in its folder, and a moment later; or at its end."""
        while self._process.poll() is None and sum(times_run(self._folder).values()) < begun:
            time.sleep(0.0005)
        time.sleep(then_s)
        self._process.kill()
        self._process.wait()
        self._input.close()
        self._output.close()

    def results(self) -> dict[str, str]:
        """Waits for its end."""
        with self._input, self._output:
            told = self._output.read()
        assert self._process.wait() == 0
        return dict(json.loads(told))


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Undisturbed:
    folder = prepare(tmp_path_factory.mktemp("undisturbed") / "run")
    results = Running(folder).go().results()
    assert set(times_run(folder).values()) == {1}
    assert set(times_run(folder)) == set(results) - {"behind-1"}
    return Undisturbed(without_folder(results, folder), content(folder))


@pytest.mark.parametrize("number", range(FIRST, FIRST + KILLS))
def test_killed_run_is_gone_on_with(number: int, undisturbed: Undisturbed, tmp_path: Path) -> None:
    random = Random(f"killed {number}")
    folder = prepare(tmp_path / "run")
    complete: dict[str, int] = {}
    for _ in range(random.choice((1, 1, 2, 3))):
        begun, left = sum(times_run(folder).values()), len(undisturbed.results) - len(complete)
        Running(folder).go().kill_at(begun + random.randrange(left), random.uniform(0, PAUSE_S))
        assert sound_files(folder, "") == store_files(folder, ""), "half a file under its whole name"
        times = times_run(folder)
        assert complete.items() <= times.items(), "a step has run again whose result was complete"
        complete = {kind: times[kind] for kind in complete_steps(folder)}
    results = run_graph(folder).results
    check_end(folder, results, undisturbed)
    assert complete.items() <= times_run(folder).items(), "a step has run again whose result was complete"


@pytest.mark.parametrize("number", range(FIRST, FIRST + PAIRS))
def test_runs_at_once_end_well_even_if_one_is_killed(number: int, undisturbed: Undisturbed, tmp_path: Path) -> None:
    random = Random(f"at once {number}")
    folder = prepare(tmp_path / "run")
    first, second, killed = (Running(folder) for _ in range(3))
    for running in (first, second, killed):
        running.go()
    killed.kill_at(random.randrange(len(undisturbed.results)), random.uniform(0, PAUSE_S))
    for running in (first, second):
        check_end(folder, running.results(), undisturbed)
    times = times_run(folder)
    check_end(folder, run_graph(folder).results, undisturbed)
    assert times_run(folder) == times


def check_end(folder: Path, results: dict[str, str], undisturbed: Undisturbed) -> None:
    assert without_folder(results, folder) == undisturbed.results
    assert content(folder) == undisturbed.files
    assert complete_steps(folder) == set(results) - {"behind-1"}


def without_folder(results: dict[str, str], folder: Path) -> dict[str, str]:
    """Results, those of a film without where it lies."""
    return {kind: result.replace(str(folder), "") for kind, result in results.items()}


def content(folder: Path) -> dict[str, bytes]:
    """Results and actions in the store; not the last action of each step, which says where the film lies."""
    assert sound_files(folder, "latest") == store_files(folder, "latest")
    return store_files(folder, "blobs") | store_files(folder, "actions")

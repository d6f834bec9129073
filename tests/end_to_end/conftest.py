"""One recorded scan and one capture, made by the command itself, and a copy of them for each test to spoil.

A bench is a folder: `workflow.yaml`, `calibration.json`, `capture/`, `archive/P0001/small/` (the scan, with its frames
in Zarr once it has run) and `results/`.
"""

import os
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from bench_scan import film_bench, laser_off_of, run_footscan
from chromium import launched
from shared_folders import MadeOnce

from pipelines.cli.main import run_command

Footscan = Callable[..., subprocess.CompletedProcess[str]]
WORKFLOW = """\
format: footscan.workflow/1
archive: archive
calibration: calibration.json
results: results
"""

USUAL_LINE = re.compile(r" steps to run$|^P\d+/\w+: ")
"""What `footscan run` writes of scans without a mistake: its plan and their warnings."""


@pytest.fixture(scope="session")
def command() -> Footscan:
    """`footscan ARGUMENTS` as a process of its own."""
    return run_footscan


@pytest.fixture
def footscan(capsys: pytest.CaptureFixture[str]) -> Footscan:
    """`footscan ARGUMENTS` within this process: the same, without waiting for Python and its libraries."""

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        capsys.readouterr()
        status = run_command([str(part) for part in arguments])
        said = capsys.readouterr()
        return subprocess.CompletedProcess(arguments, status, said.out, said.err)

    return run


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium."""
    with launched() as chromium:
        yield chromium


@pytest.fixture(scope="session")
def recorded(films: MadeOnce, made_once: MadeOnce) -> Path:
    """A bench as it is before its first run: `FRAMES` of the right foot. To be read only."""
    filmed = films("bench", film_bench)
    return made_once("recorded", lambda bench: _calibrate(filmed, bench))


@pytest.fixture(scope="session")
def laser_off_films(recorded: Path, films: MadeOnce) -> Path:
    """The pictures of camera 1 of the bench's scan, taken again with the laser off: a JPEG file each."""

    return films("laser-off", laser_off_of(recorded / "archive/P0001/small/truth.stl"))


@pytest.fixture(scope="session")
def measured(recorded: Path, made_once: MadeOnce) -> Path:
    """A bench after its first run. To be read only."""
    return made_once("measured", lambda bench: _measure(recorded, bench))


def _calibrate(filmed: Path, bench: Path) -> None:
    shutil.copytree(filmed, bench)
    done = run_footscan("calibrate", "chart", bench / "capture" / "chart.csv", "--out", bench / "calibration.json")
    assert done.returncode == 0, done.stderr
    (bench / "workflow.yaml").write_text(WORKFLOW)


def _measure(recorded: Path, bench: Path) -> None:
    shutil.copytree(recorded, bench)
    done = run_footscan("run", bench / "workflow.yaml")
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines()[0] == "40 of 40 steps to run"
    assert done.stdout == f"P0001/small: {bench / 'results' / 'P0001' / 'small'}\n"


@pytest.fixture
def fresh(recorded: Path, tmp_path: Path) -> Iterator[Path]:
    """A copy of the bench before its first run."""
    yield from _copy(recorded, tmp_path / "bench")


@pytest.fixture
def bench(measured: Path, tmp_path: Path) -> Iterator[Path]:
    """A copy of the bench after its first run."""
    yield from _copy(measured, tmp_path / "bench")


def _copy(bench: Path, to: Path) -> Iterator[Path]:
    shutil.copytree(bench, to, copy_function=_copy_or_link)
    yield to
    shutil.rmtree(to)  # 40 MB that pytest would keep


def _copy_or_link(file: str, to: str) -> None:
    """Frames and store are many files and only ever replaced: a test that damages one removes it first."""
    if "frames.zarr" in file or ".footscan" in file:
        os.link(file, to)
    else:
        shutil.copy2(file, to)


@pytest.fixture(scope="session")
def results() -> Callable[[Path], dict[str, bytes]]:
    """Of a bench: content of each result of its scan, by file name."""

    def read(bench: Path) -> dict[str, bytes]:
        folder = bench / "results" / "P0001" / "small"
        return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}

    return read


@pytest.fixture(scope="session")
def mistake() -> Callable[[subprocess.CompletedProcess[str]], str]:
    """The one line in which a command says what is wrong.

    Checks that it says nothing else but its plan and the warnings of scans.
    """

    def line(done: subprocess.CompletedProcess[str]) -> str:
        lines = [line for line in done.stderr.splitlines() if line.strip() and not USUAL_LINE.search(line)]
        assert len(lines) == 1, done.stderr
        assert lines[0].startswith("footscan: "), done.stderr
        assert "Traceback" not in done.stderr + done.stdout
        return lines[0].removeprefix("footscan: ")

    return line

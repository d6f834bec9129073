"""How the command itself behaves: help, what its start waits for, JSON for programs."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from tests.helpers.stored_frames import frame_bytes

Footscan = Callable[..., CompletedProcess[str]]
COMMANDS = [
    ["demo"],
    ["simulate", "scan"],
    ["simulate", "capture"],
    ["simulate", "world"],
    ["ingest"],
    ["extract"],
    ["calibrate", "chart"],
    ["calibrate", "capture"],
    ["calibrate", "models"],
    ["calibrate", "show"],
    ["calibrate", "check"],
    ["calibrate", "compare"],
    ["map"],
    ["run"],
    ["plan"],
    ["measure"],
    ["compare"],
]


@pytest.mark.parametrize("name", COMMANDS, ids=" ".join)
def test_help_of_each_command(footscan: Footscan, name: list[str]) -> None:
    done = footscan(*name, "--help")
    assert done.returncode == 0
    assert done.stderr == ""
    assert f"Usage: footscan {' '.join(name)}" in done.stdout
    assert "--help" in done.stdout


def test_help_names_all_commands(footscan: Footscan) -> None:
    done = footscan("--help")
    assert done.returncode == 0
    for name in COMMANDS:
        assert f" {name[0]} " in done.stdout
    assert "Exit status" in done.stdout


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"]], ids=" ".join)
def test_help_waits_for_no_heavy_library(arguments: list[str]) -> None:
    """Each of them takes as long to import as all of the rest."""
    heavy = ("numpy", "scipy", "yaml", "zarr", "dask", "numba", "skimage", "open3d", "matplotlib")
    asked = f"from pipelines.cli.main import run_command; assert run_command({arguments!r}) == 0"
    told = f"import sys; print([name for name in {heavy!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", f"{asked}; {told}"], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "workflow.yaml"),
        ("plan", "workflow.yaml"),
        ("calibrate", "chart", "capture/chart.csv"),
        ("calibrate", "chart", "capture/chart.csv", "--model", "quadratic"),
        ("calibrate", "show", "calibration.json"),
        ("calibrate", "compare", "calibration.json", "calibration.json"),
        ("map", "calibration.json", "pixels.csv", "--camera", "1"),
        ("measure", "results/P0001/small/foot.stl"),
        ("compare", "results/P0001/small/cloud.ply", "archive/P0001/small/truth.stl"),
        ("extract", "archive/P0001/small/frame.jpg", "--out", "points.csv"),
        ("ingest", "archive/P0001/small"),
    ],
    ids=lambda arguments: " ".join(arguments[:2]) if arguments[0] == "calibrate" else arguments[0],
)
def test_json_stands_alone_on_standard_output(
    footscan: Footscan, bench: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...]
) -> None:
    monkeypatch.chdir(bench)
    Path("pixels.csv").write_text("i,j\n320,240\n")
    scan = Path("archive/P0001/small")
    (scan / "frame.jpg").write_bytes(frame_bytes(scan / "frames.zarr/cam1", 40))
    done = footscan(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    json.loads(done.stdout, parse_constant=pytest.fail)  # no NaN
    without = footscan(*arguments)
    assert without.returncode == 0
    with pytest.raises(ValueError, match=r"Expecting value|Extra data"):
        json.loads(without.stdout)


def test_names_in_a_table_are_no_markup(footscan: Footscan, bench: Path) -> None:
    strange = bench / "[red]foot.stl"
    (bench / "results/P0001/small/foot.stl").rename(strange)
    done = footscan("compare", strange, bench / "archive/P0001/small/truth.stl")
    assert "[red]foot.stl to truth.stl, mm" in done.stdout

"""How the command itself behaves: help, what its start waits for, JSON for programs."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

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


def test_version_and_groups(footscan: Footscan) -> None:
    done = footscan("--version")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("footscan ")
    shown = footscan("--help").stdout
    groups = ["Scan", "Results", "Calibration", "Archive", "Verification"]
    assert [group for group in groups if f"─ {group} ─" in shown] == groups


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_commands_are_completed(shell: str) -> None:
    """As the scripts ask that `--install-completion` writes."""
    asked = {
        "bash": {"COMP_WORDS": "footscan cal", "COMP_CWORD": "1"},
        "zsh": {"_TYPER_COMPLETE_ARGS": "footscan cal"},
        "fish": {"_TYPER_COMPLETE_ARGS": "footscan cal", "_TYPER_COMPLETE_FISH_ACTION": "get-args"},
    }[shell]
    done = subprocess.run(
        [Path(sys.executable).with_name("footscan")],
        env={**os.environ, "_FOOTSCAN_COMPLETE": f"complete_{shell}", **asked},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "calibrate" in done.stdout
    assert "regress" not in done.stdout


def test_every_help_says_what_its_exit_status_means() -> None:
    import typer

    from pipelines.cli.main import STATUS_1, app
    from pipelines.cli.terminal.norms import with_norms

    def leaves(command: Any, *path: str) -> Iterator[tuple[str, Any]]:
        for name, below in getattr(command, "commands", {}).items():
            yield from leaves(below, *path, name)
        if not hasattr(command, "commands"):
            yield " ".join(path), command

    found = dict(leaves(with_norms(typer.main.get_command(app), STATUS_1)))
    assert STATUS_1.keys() <= found.keys()
    for name, command in found.items():
        assert command.epilog.startswith("Exit status: 0 "), name
        assert any("--quiet" in parameter.opts for parameter in command.params), name


def test_quiet_leaves_results_and_problems(footscan: Footscan, bench: Path, tmp_path: Path) -> None:
    frame = tmp_path / "cam1.jpg"
    frame.write_bytes(frame_bytes(bench / "archive/P0001/small/frames.zarr/cam1", 40))
    loud = footscan("extract", frame, "--out", tmp_path / "points.csv")
    quiet = footscan("extract", frame, "--out", tmp_path / "points.csv", "-q")
    refused = footscan("extract", tmp_path / "cam2.jpg", "--out", tmp_path / "points.csv", "--quiet")
    again = footscan("extract", frame, "--out", tmp_path / "points.csv")
    assert (loud.returncode, quiet.returncode, refused.returncode) == (0, 0, 2)
    assert (quiet.stderr, again.stderr) == ("", loud.stderr)
    assert "cam1.jpg" in loud.stderr
    assert "cam2.jpg: no such film" in refused.stderr


def test_no_colour_where_none_is_wanted() -> None:
    def shown(**environment: str) -> str:
        command = [Path(sys.executable).with_name("footscan"), "--help"]
        inherited = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "FORCE_COLOR")}
        return subprocess.run(command, env=inherited | environment, capture_output=True, text=True, check=True).stdout

    colours = r"\x1b\[[0-9;]*3[0-7]m"
    assert re.search(colours, shown(FORCE_COLOR="1"))
    assert not re.search(colours, shown(FORCE_COLOR="1", NO_COLOR="1"))

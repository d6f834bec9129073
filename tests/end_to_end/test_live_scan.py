"""The commands of the live scanner, on the virtual one."""

import json
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from footscan.frames.travel import read_positions
from footscan.recordings.scans import read_scan
from footscan.virtual.foot.foot import make_foot
from pipelines.live.virtual import rig as virtual_rig
from pipelines.live.virtual.world import CAMERAS

pytestmark = pytest.mark.real_time  # cameras stream while heads move

Footscan = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a virtual scanner as it is delivered."""
    return tmp_path_factory.mktemp("virtual")


def test_heads_are_homed_and_moved(footscan: Footscan, folder: Path) -> None:
    done = footscan("jog", "2", "30", "--virtual", "--virtual-folder", folder, "--json")
    assert done.returncode == 0, done.stderr
    x = json.loads(done.stdout)["x_mm"]
    assert x[1] - x[0] == pytest.approx(30.0, abs=0.05)
    assert x[0] == pytest.approx(x[2], abs=0.05)


def test_devices_of_a_rig_are_told(footscan: Footscan, folder: Path) -> None:
    done = footscan("devices", "--virtual", "--virtual-folder", folder, "--json")
    assert done.returncode == 0, done.stderr
    rig = json.loads(done.stdout)["rig"]
    assert [camera["camera"] for camera in rig["cameras"]] == list(CAMERAS)
    assert [camera["head"] for camera in rig["cameras"]] == [1, 1, 2, 2, 3, 3, 3, 3]
    assert [each["cameras"] for each in rig["passes"]] == [list(CAMERAS)]


@pytest.mark.slow
def test_a_scan_is_filmed_and_stored(
    footscan: Footscan, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(virtual_rig, "_calibrate", None)  # the scanner is delivered with a calibration
    done = footscan(
        "scan", "P0001", "right", "--virtual", "--virtual-folder", folder, "--out", tmp_path / "archive",
        "--from-mm", "180", "--to-mm", "210", "--speed", "60", "--grid-mm", "3", "--no-measure", "--json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    scan = read_scan(Path(told["scan"]))
    assert [camera.id for camera in scan.document.cameras] == list(CAMERAS)
    for camera in scan.document.cameras:
        x = read_positions(scan.folder / str(camera.positions))
        assert np.all(np.diff(x) > 0)
        assert np.median(np.diff(x)) == pytest.approx(60.0 / (200 / 11), rel=0.2)
        assert 180 <= x[0] < 195
        assert 195 < x[-1] <= 210


@pytest.mark.slow
def test_a_scan_of_the_scanner_as_it_is_delivered_is_measured(footscan: Footscan, folder: Path, tmp_path: Path) -> None:
    done = footscan(
        "scan", "P0001", "right", "--virtual", "--virtual-folder", folder, "--out", tmp_path / "archive",
        "--results", tmp_path / "results", "--json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["left_out"] == {}
    foot = make_foot(side="right")
    for name in ("foot_length", "foot_breadth", "ball_girth"):
        measure = told["measures"][name]
        assert measure["value"] == pytest.approx(foot.measures[name], abs=max(0.3, 3.0 * measure["uncertainty"])), name


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("home",), "rig.yaml: no such file"),
        (("scan", "P 1", "right"), "PATIENT: expected 1 to 64 letters, digits, '-' and '_', found 'P 1'"),
        (("scan", "P1", "right", "--virtual", "--rig", "a.yaml"), "--rig: goes without --virtual"),
    ],
)
def test_wrong_use_is_refused_in_one_line(
    footscan: Footscan,
    mistake: Callable[[subprocess.CompletedProcess[str]], str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    problem: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    begin = time.monotonic()
    done = footscan(*arguments)
    assert done.returncode == 2
    assert mistake(done).startswith(problem)
    assert time.monotonic() - begin < 60

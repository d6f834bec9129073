"""Captures that the virtual scanner films, of its own reference object and of another."""

from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest

from footscan.virtual.stage.reference import standard_reference
from pipelines.recordings.captures import read_capture

Footscan = Callable[..., CompletedProcess[str]]
Mistake = Callable[[CompletedProcess[str]], str]
BOX = """\
format: footscan.reference/1
profile_mm: [[-25, 0], [25, 0], [25, 40], [-25, 40]]
placements_mm: [[0, 0], [10, 5], [-10, 5]]
"""


def test_the_first_placements_alone(footscan: Footscan, tmp_path: Path) -> None:
    done = footscan("simulate", "capture", "--out", tmp_path / "capture", "--placements", "2", "--light", "dark")
    assert (done.returncode, done.stdout) == (0, "")
    assert "filmed the reference object in 2 placements" in done.stderr
    capture = read_capture(tmp_path / "capture")
    standard = standard_reference()
    assert capture.reference.profile_mm == standard.profile_mm
    assert capture.reference.placements_mm == standard.placements_mm[:2]
    assert "stands" not in capture.file.read_text()
    assert [camera.id for camera in capture.document.cameras] == list(range(1, 9))


def test_a_reference_object_of_ones_own(footscan: Footscan, tmp_path: Path) -> None:
    (tmp_path / "box.yaml").write_text(BOX)
    done = footscan(
        "simulate", "capture", "--out", tmp_path / "capture", "--reference", tmp_path / "box.yaml", "--placements", "1"
    )
    assert done.returncode == 0, done.stderr
    assert "in 1 placement," in done.stderr
    capture = read_capture(tmp_path / "capture")
    assert capture.reference.profile_mm == [[-25, 0], [25, 0], [25, 40], [-25, 40]]
    assert capture.reference.placements_mm == [[0, 0]]
    chart = np.loadtxt(tmp_path / "capture/chart.csv", delimiter=",", skiprows=1)
    corners = {tuple(row) for row in chart[:, 3:5].tolist()}
    assert corners == {(-25.0, 0.0), (25.0, 0.0), (25.0, 40.0), (-25.0, 40.0)}


@pytest.mark.parametrize(
    ("options", "old", "new", "told"),
    [
        (["--placements", "4"], "", "", "--placements: the reference object has 3, expected at most as many, found 4"),
        (["--placements", "0"], "", "", "--placements"),
        ([], "[10, 5]", "[10, -5]", "box.yaml: placements_mm.1: reaches down to Z = -5 mm, expected the object on the"),
        ([], "[10, 5]", "[0, 0]", "box.yaml: placements_mm: placement 1 repeats placement 0, expected each"),
        ([], "[25, 40], [-25, 40]", "[-25, 40], [25, 40]", "cross or touch, expected a polygon that does not meet"),
        ([], "profile_mm", "profile", "box.yaml: profile: unknown field, did you mean 'profile_mm'?"),
    ],
)
def test_what_cannot_be_filmed(
    footscan: Footscan, mistake: Mistake, tmp_path: Path, options: list[str], old: str, new: str, told: str
) -> None:
    (tmp_path / "box.yaml").write_text(BOX.replace(old, new) if old else BOX)
    done = footscan(
        "simulate", "capture", "--out", tmp_path / "capture", "--reference", tmp_path / "box.yaml", *options
    )
    assert done.returncode == 2
    assert told in mistake(done)
    assert not (tmp_path / "capture").exists()

"""A film of the standard body, with its X spoilt as by heads that are not where they should be."""

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from bench_scan import FILMING_SECONDS, run_footscan
from shared_folders import MadeOnce

STEP_MM = 6.0
OFFSETS_MM = {1: 0.8, 2: 0.8, 3: -1.1, 4: -1.1, 5: 0.3, 6: 0.3, 7: 0.3, 8: 0.3}
"""By camera; the heads carry 1 and 2, 3 and 4, 5 to 8."""


def film_body(folder: Path) -> None:
    folder.mkdir()
    for arguments in (
        ("calibrate", "body", folder / "body.stl"),
        ("simulate", "scan", folder / "body.stl", "--turn-deg", 20, "--frames", 30, "--step-mm", STEP_MM, "--out",
         folder / "film"),
    ):  # fmt: skip
        done = run_footscan(*arguments, timeout=FILMING_SECONDS)
        assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def body(films: MadeOnce) -> Path:
    """To be read only."""
    return films("body", film_body)


@pytest.fixture
def film(body: Path, tmp_path: Path) -> Path:
    """The film, in which each head says that it is somewhere else."""
    shutil.copytree(body / "film", tmp_path / "film")
    place = tmp_path / "film" / "scan.yaml"
    document = yaml.safe_load(place.read_text())
    for camera in document["cameras"]:
        camera["travel"] = {"start_mm": document["travel"]["start_mm"] - OFFSETS_MM[camera["id"]], "step_mm": STEP_MM}
    place.write_text(yaml.safe_dump(document))
    return tmp_path / "film"


def test_heads_that_are_off_are_found_in_a_film(
    film: Path, body: Path, recorded: Path, tmp_path: Path, footscan: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    made = tmp_path / "made.json"
    done = footscan(
        "calibrate", "travel", film, "--calibration", recorded / "calibration.json", "--body", body / "body.stl",
        "--out", made, "--json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    planes: dict[str, Any] = json.loads(done.stdout)["planes"]
    mean = (OFFSETS_MM[1] + OFFSETS_MM[3] + OFFSETS_MM[5]) / 3
    for camera, offset in OFFSETS_MM.items():
        assert planes[str(camera)]["offset_mm"] == pytest.approx(offset - mean, abs=0.05)
        assert abs(planes[str(camera)]["yaw"]) < 0.003
    assert json.loads(made.read_text())["format"] == "footscan.calibration/4"


def test_a_camera_that_lost_a_frame_is_named(
    film: Path, body: Path, recorded: Path, footscan: Callable[..., subprocess.CompletedProcess[str]],
    mistake: Callable[[subprocess.CompletedProcess[str]], str],
) -> None:  # fmt: skip
    place = film / "scan.yaml"
    document = yaml.safe_load(place.read_text())
    document["cameras"][5]["travel"]["start_mm"] += STEP_MM
    place.write_text(yaml.safe_dump(document))
    done = footscan(
        "calibrate", "travel", film, "--calibration", recorded / "calibration.json", "--body", body / "body.stl"
    )
    assert done.returncode == 2
    assert "camera 6 was 1.0 frames off the other cameras of its head" in mistake(done)


def test_a_film_of_a_foot_is_refused(
    fresh: Path, footscan: Callable[..., subprocess.CompletedProcess[str]],
    mistake: Callable[[subprocess.CompletedProcess[str]], str],
) -> None:  # fmt: skip
    done = footscan("calibrate", "travel", fresh / "archive/P0001/small", "--calibration", fresh / "calibration.json")
    assert done.returncode == 2
    assert "is it the film of this body" in mistake(done)


def test_a_rig_without_a_camera_is_refused(
    film: Path, recorded: Path, tmp_path: Path, footscan: Callable[..., subprocess.CompletedProcess[str]],
    mistake: Callable[[subprocess.CompletedProcess[str]], str],
) -> None:  # fmt: skip
    rig = tmp_path / "rig.yaml"
    rig.write_text(
        "format: footscan.rig/1\nscanner: home\nport: /dev/ttyACM0\ncameras: [{id: 1, device: /dev/video0}]\n"
    )
    done = footscan("calibrate", "travel", film, "--calibration", recorded / "calibration.json", "--rig", rig)
    assert done.returncode == 2
    assert "says no head of camera 2" in mistake(done)

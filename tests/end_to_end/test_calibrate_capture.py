"""`footscan calibrate capture` on films of the virtual scanner, whose true maps are known."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
import yaml

from footscan.calibration.maps import is_supported, to_world
from footscan.virtual.scanner import standard_scanner
from schemas.calibration import read_calibration

Footscan = Callable[..., CompletedProcess[str]]
PLACEMENTS = 3
GRID = np.stack(np.meshgrid(np.linspace(-70, 70, 57), np.linspace(0, 114, 39)), -1).reshape(-1, 2)


@pytest.fixture(scope="module")
def filmed(command: Footscan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("filmed") / "capture"
    done = command("simulate", "capture", "--out", folder, "--placements", PLACEMENTS, "--scanner-seed", 3)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def capture(filmed: Path, tmp_path: Path) -> Path:
    """A copy to spoil."""
    return Path(shutil.copytree(filmed, tmp_path / "capture"))


def test_every_map_is_near_the_truth(footscan: Footscan, capture: Path, tmp_path: Path) -> None:
    done = footscan("calibrate", "capture", capture, "--out", tmp_path / "calibration.json", "--json")
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert [camera["camera"] for camera in report["cameras"]] == list(range(1, 9))
    assert all(pair["rms_mm"] < 0.05 for pair in report["pairs"])
    calibration = read_calibration(tmp_path / "calibration.json")
    assert calibration.created is not None
    assert {source.name for source in calibration.sources} >= {"capture.yaml", "reference.yaml", "cam1.avi"}
    scanner = standard_scanner(3)
    for camera in calibration.cameras:
        pixels = scanner.camera(camera.camera).project_plane(GRID[:, 0], GRID[:, 1])
        inside = is_supported(camera, pixels)
        errors = np.linalg.norm(to_world(camera, pixels[inside]) - GRID[inside], axis=1)
        assert inside.sum() > 100
        assert np.sqrt(np.mean(errors**2)) < (0.05 if camera.camera < 5 else 0.08), camera.camera
        assert errors.max() < (0.15 if camera.camera < 5 else 0.3), camera.camera


def test_the_table_names_the_chosen_model_and_the_pairs(footscan: Footscan, capture: Path) -> None:
    done = footscan("calibrate", "capture", capture)
    assert done.returncode == 0
    assert "chosen" in done.stdout
    assert "1 and 2" in done.stdout
    assert "nothing was written" in done.stderr


def place(capture: Path, placements: list[list[float]]) -> None:
    file = capture / "reference.yaml"
    document = yaml.safe_load(file.read_text())
    document["placements_mm"] = placements
    file.write_text(yaml.safe_dump(document))


def placements_of(capture: Path) -> list[list[float]]:
    return list(yaml.safe_load((capture / "reference.yaml").read_text())["placements_mm"])


def test_an_object_that_stood_elsewhere_is_refused(footscan: Footscan, capture: Path, tmp_path: Path) -> None:
    said = placements_of(capture)
    place(capture, [said[0], [said[1][0] + 5.0, said[1][1]], said[2]])
    done = footscan("calibrate", "capture", capture, "--out", tmp_path / "calibration.json")
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.strip().splitlines()) == 1
    assert "capture.yaml: frame 1: the object stood at" in done.stderr
    assert "as placements_mm says" in done.stderr
    assert not (tmp_path / "calibration.json").exists()


def test_a_dark_frame_of_all_cameras_is_refused(footscan: Footscan, capture: Path) -> None:
    from PIL import Image

    for film in capture.glob("*.avi"):
        film.unlink()
    document = yaml.safe_load((capture / "capture.yaml").read_text())
    document["cameras"] = [{"id": 1, "file": "cam1/"}]
    (capture / "capture.yaml").write_text(yaml.safe_dump(document))
    (capture / "cam1").mkdir()
    for number in range(PLACEMENTS):
        Image.new("RGB", (640, 480)).save(capture / f"cam1/{number}.png")
    done = footscan("calibrate", "capture", capture)
    assert done.returncode == 2
    assert "frame 0: shows no stripe in any camera, expected the object" in done.stderr


def test_a_model_by_name(footscan: Footscan, capture: Path) -> None:
    done = footscan("calibrate", "capture", capture, "--model", "homography-distortion", "--json")
    assert done.returncode == 0
    assert all(camera["map"]["distortion"] is not None for camera in json.loads(done.stdout)["cameras"])
    assert footscan("calibrate", "capture", capture, "--order", 3).returncode == 2

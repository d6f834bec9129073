"""`footscan calibrate compare`: is this calibration the same as that one, and where does it differ?"""

import json
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest

Footscan = Callable[..., CompletedProcess[str]]
Mistake = Callable[[CompletedProcess[str]], str]
FROZEN = Path(__file__).parents[1] / "schemas" / "frozen"
V1, V2, V3 = (FROZEN / f"calibration-{version}.json" for version in ("1-cm", "2", "3"))
KEYS = [
    "camera", "model_a", "model_b", "image_a_px", "image_b_px", "shared_fraction", "pixels", "mean_y_mm", "mean_z_mm",
    "rms_mm", "largest_mm", "largest_at_px", "turn_deg", "left_rms_mm", "remarks",
]  # fmt: skip


@pytest.fixture
def moved(tmp_path: Path) -> Path:
    """Version 3's calibration with camera 5 shifted by (0.03, -0.04) mm."""
    document = json.loads(V3.read_text())
    document["cameras"][1]["map"]["alpha_y"][0] += 0.03
    document["cameras"][1]["map"]["alpha_z"][0] -= 0.04
    (tmp_path / "moved.json").write_text(json.dumps(document))
    return tmp_path / "moved.json"


def test_a_calibration_and_itself(footscan: Footscan) -> None:
    done = footscan("calibrate", "compare", V3, V3, "--tolerance-mm", 0)
    assert (done.returncode, done.stderr) == (0, "")
    assert "homography, distortion" in done.stdout
    assert "Camera 5: neither says its region: compared over the image." in done.stdout.splitlines()


def test_version_1_and_version_3(footscan: Footscan) -> None:
    """Camera 5 in version 1, in mm: Y = 20, Z = 0.1 j; in version 3: Y = 0.1 i - 27, Z = 98 - 0.2 j.

    B minus A is (0.1 i - 47, 98 - 0.3 j), over all pixels of 640 x 480.
    """
    done = footscan("calibrate", "compare", V1, V3, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    first, fifth = json.loads(done.stdout)
    assert list(first) == list(fifth) == KEYS
    assert (first["camera"], first["model_a"]) == (1, "polynomial 2")
    assert first["model_b"] == "homography, distortion, correction 2"
    assert first["remarks"] == ["A does not say its region: compared over that of the other"]
    assert (fifth["camera"], fifth["model_a"], fifth["model_b"]) == (5, "polynomial 2", "polynomial 1")
    assert (fifth["image_a_px"], fifth["image_b_px"]) == (None, [640, 480])
    assert (fifth["shared_fraction"], fifth["pixels"]) == (None, 640 * 480)
    mean_y, mean_z = 0.1 * 319.5 - 47, 98 - 0.3 * 239.5
    variance = 0.01 * (640**2 - 1) / 12 + 0.09 * (480**2 - 1) / 12
    assert fifth["mean_y_mm"] == pytest.approx(mean_y)
    assert fifth["mean_z_mm"] == pytest.approx(mean_z)
    assert fifth["rms_mm"] == pytest.approx(np.sqrt(mean_y**2 + mean_z**2 + variance))
    assert fifth["largest_mm"] == pytest.approx(np.hypot(47, 98))
    assert fifth["largest_at_px"] == [0, 0]


def test_the_table(footscan: Footscan, moved: Path) -> None:
    done = footscan("calibrate", "compare", V3, moved)
    assert (done.returncode, done.stderr) == (0, "")
    [row] = [line for line in done.stdout.splitlines() if line.startswith("│      5 │")]
    cells = [cell.strip() for cell in row.split("│")[1:-1]]
    assert cells[:7] == ["5", "polynomial 1", "-", "+0.030", "-0.040", "0.050", "0.050"]
    assert cells[-1] == "0.000"


@pytest.mark.parametrize("options", [(), ("--json",)])
def test_the_tolerance_decides_on_the_exit_status(footscan: Footscan, moved: Path, options: tuple[str, ...]) -> None:
    within = footscan("calibrate", "compare", V3, moved, "--tolerance-mm", 0.051, *options)
    assert (within.returncode, within.stderr) == (0, "")
    beyond = footscan("calibrate", "compare", V3, moved, "--tolerance-mm", 0.049, *options)
    assert beyond.returncode == 1
    assert beyond.stderr == "camera 5 differs most: 0.05 mm rms, more than 0.049 mm\n"
    assert beyond.stdout == within.stdout


def test_the_process_ends_with_that_status(command: Footscan, moved: Path) -> None:
    assert command("calibrate", "compare", V3, moved, "--tolerance-mm", 0.01).returncode == 1
    assert command("calibrate", "compare", V3, moved).returncode == 0


def test_a_camera_that_one_of_them_has_not(footscan: Footscan) -> None:
    done = footscan("calibrate", "compare", V2, V3)
    assert (done.returncode, done.stderr) == (0, "")
    assert {"Camera 3: in A alone.", "Camera 5: in B alone."} <= set(done.stdout.splitlines())
    done = footscan("calibrate", "compare", V2, V3, "--tolerance-mm", 1000)
    assert (done.returncode, done.stderr) == (1, "camera 3 cannot be compared: in A alone\n")


def test_no_camera_in_common(footscan: Footscan) -> None:
    done = footscan("calibrate", "compare", FROZEN / "calibration-1-mm.json", V3)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == ["Cameras 1, 5: in B alone.", "Camera 3: in A alone."]


@pytest.mark.parametrize("damaged_first", [True, False])
def test_a_damaged_file_is_one_line(footscan: Footscan, mistake: Mistake, tmp_path: Path, damaged_first: bool) -> None:
    damaged = tmp_path / "damaged.json"
    damaged.write_text(V3.read_text()[:-100])
    done = footscan("calibrate", "compare", *((damaged, V3) if damaged_first else (V3, damaged)))
    assert (done.returncode, done.stdout) == (2, "")
    assert mistake(done).startswith(f"{damaged}: ")


@pytest.mark.parametrize("tolerance", ["-1", "much"])
def test_a_tolerance_that_is_none(footscan: Footscan, mistake: Mistake, tolerance: str) -> None:
    done = footscan("calibrate", "compare", V3, V3, "--tolerance-mm", tolerance)
    assert done.returncode == 2
    assert "--tolerance-mm" in mistake(done)

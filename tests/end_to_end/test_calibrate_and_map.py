"""Charts to calibrations, and pixels to millimetres."""

import csv
import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from footscan.thesis.printed import CHARTS_FILE, COEFFICIENTS_FILE
from schemas.calibration import read_calibration

Footscan = Callable[..., CompletedProcess[str]]
CHART = CHARTS_FILE


def test_quadratic_calibration_of_a_chart_in_centimetres(footscan: Footscan) -> None:
    done = footscan("calibrate", "chart", CHART, "--model", "quadratic", "--json")
    assert done.returncode == 0
    assert "camera 5: residual 4.9 px rms" in done.stderr
    cameras = json.loads(done.stdout)
    assert [camera["camera"] for camera in cameras] == list(range(1, 9))
    for camera in cameras:
        assert {"camera", "model", "alpha_y", "alpha_z", "r2_y", "r2_z"} <= set(camera)
        assert camera["model"] == "quadratic"
        assert len(camera["alpha_y"]) == len(camera["alpha_z"]) == 6
    with COEFFICIENTS_FILE.open(newline="") as file:
        printed = list(csv.DictReader(file))
    terms = ["1", "i", "j", "i^2", "ij", "j^2"]
    assert len(printed) == 43
    for row in printed:
        camera, term = cameras[int(row["camera"]) - 1], terms.index(row["term"])
        for axis in ("alpha_y", "alpha_z"):
            half_a_digit = 0.5 * 10.0 ** -int(row["decimals"])
            assert camera[axis][term] == pytest.approx(float(row[axis]), abs=1.001 * half_a_digit), row


def test_a_quadratic_calibration_maps_its_own_points(footscan: Footscan, tmp_path: Path) -> None:
    """Five points and six unknowns: the control points themselves are met, in mm although the chart is in cm."""
    done = footscan("calibrate", "chart", CHART, "--model", "quadratic", "--out", tmp_path / "c.json")
    assert done.returncode == 0
    assert "R^2" in done.stdout
    points = [row for row in csv.DictReader(CHART.read_text().splitlines()) if row["camera"] == "4"]
    pixels = tmp_path / "pixels.csv"
    pixels.write_text("name,j,i\n" + "".join(f"{row['point']},{row['j']},{row['i']}\n" for row in points))
    done = footscan("map", tmp_path / "c.json", pixels, "--camera", 4, "--out", tmp_path / "world.csv")
    assert (done.returncode, done.stdout) == (0, "")
    with (tmp_path / "world.csv").open(newline="") as file:
        world = csv.DictReader(file)
        assert world.fieldnames == ["y_mm", "z_mm", "supported"]
        for found, row in zip(world, points, strict=True):
            assert float(found["y_mm"]) == pytest.approx(10 * float(row["y_cm"]), abs=1e-3)
            assert float(found["z_mm"]) == pytest.approx(10 * float(row["z_cm"]), abs=1e-3)


def test_the_captures_chart_is_met_to_a_clicks_accuracy(footscan: Footscan, measured: Path) -> None:
    """Corners are clicked to half a pixel, and a pixel is about 0.3 mm."""
    done = footscan("calibrate", "chart", measured / "capture/chart.csv", "--json")
    cameras = json.loads(done.stdout)
    assert [camera["camera"] for camera in cameras] == list(range(1, 9))
    for camera in cameras:
        print(f"camera {camera['camera']}: {camera['model']}, held out {camera['held_out_rms_mm']:.3f} mm")
        assert camera["rms_mm"] < camera["held_out_rms_mm"] < 0.5
        assert camera["model"].startswith("homography")
        assert camera["map"]["model"] == "homography"
        assert camera["warnings"] == []
        trials = {trial["model"]: trial for trial in camera["models"]}
        assert [name for name, trial in trials.items() if trial["status"] == "chosen"] == [camera["model"]]
        assert camera["held_out_rms_mm"] < 0.8 * trials["polynomial 2"]["held_out_rms_mm"]
        assert {"polynomial 5", "homography", "homography, distortion"} <= set(trials)
    table = footscan("calibrate", "chart", measured / "capture/chart.csv").stdout
    assert "chosen" in table
    assert "Held-out: the same for points that it has not seen" in table


@pytest.mark.parametrize(
    ("options", "model", "unknowns"),
    [
        (["--model", "homography"], "homography", 8),
        (["--model", "homography-distortion"], "homography, distortion", 12),
        (["--model", "polynomial", "--order", "3"], "polynomial 3", 20),
    ],
)
def test_the_model_that_was_asked_for(
    footscan: Footscan, measured: Path, options: list[str], model: str, unknowns: int
) -> None:
    done = footscan("calibrate", "chart", measured / "capture/chart.csv", *options, "--json")
    for camera in json.loads(done.stdout):
        assert (camera["model"], camera["unknowns"]) == (model, unknowns)
        assert [trial["model"] for trial in camera["models"]] == [model]


def test_a_written_calibration_says_when_it_was_made(footscan: Footscan, tmp_path: Path) -> None:
    before = datetime.now(UTC).replace(microsecond=0)
    footscan("calibrate", "chart", CHART, "--out", tmp_path / "c.json")
    created = read_calibration(tmp_path / "c.json").created
    assert created is not None
    assert before <= created <= datetime.now(UTC)


def test_a_certain_mistake_is_refused_unless_one_goes_on(
    footscan: Footscan, mistake: Callable[[CompletedProcess[str]], str], tmp_path: Path
) -> None:
    chart = tmp_path / "chart.csv"
    chart.write_text(CHART.read_text().replace("3,P4,0,-2,10,207,227", "3,P4,0,-2,10,207,2270"))
    done = footscan("calibrate", "chart", chart, "--out", tmp_path / "c.json")
    assert done.returncode == 2
    line = mistake(done)
    assert line.startswith(f"{chart}: camera 3, point P4: i = 207, j = 2270 lies outside of the image, expected ")
    assert "j = 227 would fit" in line
    assert not (tmp_path / "c.json").exists()
    done = footscan("calibrate", "chart", chart, "--out", tmp_path / "c.json", "--keep-going")
    assert done.returncode == 0
    assert "camera 3, point P4: i = 207, j = 2270 lies outside of the image" in done.stderr
    assert (tmp_path / "c.json").exists()


def test_a_likely_mistake_is_told_and_calibrated(footscan: Footscan, tmp_path: Path) -> None:
    chart = tmp_path / "chart.csv"
    chart.write_text(CHART.read_text().replace("3,P2,0,-5,7,413,204", "3,P2,0,5,7,413,204"))
    done = footscan("calibrate", "chart", chart, "--json")
    assert done.returncode == 0
    assert "camera 3, point P2: " in done.stderr
    [warning] = json.loads(done.stdout)[2]["warnings"]
    assert (warning["point"], warning["kind"]) == ("P2", "mistyped")
    assert "y_cm = -5 would fit, found 5 (a wrong sign)" in warning["message"]


def test_the_models_of_the_thesis_compared(footscan: Footscan) -> None:
    """A homography has a residual and may be judged; a quadratic of five points has none, and fails on a sixth."""
    done = footscan("calibrate", "models", CHART, "--json")
    assert done.returncode == 0
    for camera in json.loads(done.stdout):
        trials = {trial["model"]: trial for trial in camera["models"]}
        quadratic, homography = trials["quadratic of the thesis"], trials["homography"]
        assert quadratic["rms_mm"] < 1e-6
        assert 0.1 < homography["rms_mm"] < 2
        assert trials["polynomial 2"]["status"] == "refused"
        if camera["camera"] in (1, 2, 3, 4, 6, 8):
            assert 50 < quadratic["held_out_rms_mm"] < 1000
            assert homography["held_out_rms_mm"] < 20
    assert "quadratic of the thesis" in footscan("calibrate", "models", CHART).stdout


def test_the_table_in_the_documentation_is_current(footscan: Footscan) -> None:
    page = (Path(__file__).parents[2] / "docs" / "calibration.md").read_text(encoding="utf-8")
    table = page.split("<!-- models: the thesis's chart -->\n")[1].split("<!-- end of models -->")[0]
    assert footscan("calibrate", "models", CHART, "--markdown").stdout == table


def test_a_pixel_without_support_is_told(footscan: Footscan, measured: Path, tmp_path: Path) -> None:
    chart = measured / "capture/chart.csv"
    first = next(row for row in csv.DictReader(chart.read_text().splitlines()) if row["camera"] == "1")
    rows = [row for row in csv.DictReader(chart.read_text().splitlines()) if row["camera"] == "1"]
    middle = (sum(float(row["i"]) for row in rows) / len(rows), sum(float(row["j"]) for row in rows) / len(rows))
    (tmp_path / "pixels.csv").write_text(f"i,j\n{middle[0]},{middle[1]}\n-500,-500\n{first['i']},{first['j']}\n")
    done = footscan("map", measured / "calibration.json", tmp_path / "pixels.csv", "--camera", 1, "--json")
    mapped = json.loads(done.stdout)
    assert [row["supported"] for row in mapped[:2]] == [True, False]
    assert mapped[2]["y_mm"] == pytest.approx(float(first["y_mm"]), abs=1.0)
    assert mapped[2]["z_mm"] == pytest.approx(float(first["z_mm"]), abs=1.0)
    printed = footscan("map", measured / "calibration.json", tmp_path / "pixels.csv", "--camera", 1).stdout
    assert printed.splitlines()[0] == "y_mm,z_mm,supported"
    assert printed.splitlines()[2].endswith(",false")


def test_no_point_is_mapped_to_no_point(footscan: Footscan, measured: Path, tmp_path: Path) -> None:
    (tmp_path / "pixels.csv").write_text("i,j\n")
    done = footscan("map", measured / "calibration.json", tmp_path / "pixels.csv", "--camera", 2)
    assert (done.returncode, done.stdout) == (0, "y_mm,z_mm,supported\n")

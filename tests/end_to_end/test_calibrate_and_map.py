"""Charts to calibrations, and pixels to millimetres."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest

Footscan = Callable[..., CompletedProcess[str]]
DATA = Path(__file__).parents[1] / "footscan" / "calibration" / "data"
CHART = DATA / "calibration_charts.csv"


def test_quadratic_calibration_of_a_chart_in_centimetres(footscan: Footscan) -> None:
    done = footscan("calibrate", "chart", CHART, "--model", "quadratic", "--json")
    assert done.returncode == 0
    cameras = json.loads(done.stdout)
    assert [camera["camera"] for camera in cameras] == list(range(1, 9))
    for camera in cameras:
        assert {"camera", "model", "alpha_y", "alpha_z", "r2_y", "r2_z"} <= set(camera)
        assert camera["model"] == "quadratic"
        assert len(camera["alpha_y"]) == len(camera["alpha_z"]) == 6
    with (DATA / "printed_coefficients.csv").open(newline="") as file:
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
        print(f"camera {camera['camera']}: order {camera['order']}, held out {camera['held_out_rms_mm']:.3f} mm")
        assert camera["rms_mm"] < camera["held_out_rms_mm"] < 0.5
        assert camera["order"] >= 2


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

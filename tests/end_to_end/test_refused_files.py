"""Wrong use, and files that are not what they should be: one line, exit status 2, nothing written."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
import trimesh

from footscan.virtual.foot.foot import make_foot

Footscan = Callable[..., CompletedProcess[str]]
Mistake = Callable[[CompletedProcess[str]], str]
Refuse = Callable[..., str]
CHART = "camera,point,x_mm,y_mm,z_mm,i,j\n1,P1,0,50,30,159,221\n1,P2,0,50,70,318,170\n"


@pytest.fixture
def refuse(footscan: Footscan, mistake: Mistake) -> Refuse:
    """What `footscan ARGUMENTS` says of a mistake."""

    def run(*arguments: object) -> str:
        done = footscan(*arguments)
        assert done.returncode == 2, done.stderr
        assert done.stdout == ""
        return mistake(done)

    return run


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["run", "--fast"], "--fast"),
        (["walk"], "No such command 'walk'"),
        (["run", "--workers", "0"], "--workers"),
        (["run", "--workers", "two"], "--workers"),
        (["run", "nowhere.yaml"], "nowhere.yaml: no such file"),
        (["run", "--scan", "somewhere"], "--out: is missing"),
        (["run", "--out", "somewhere"], "--out: goes with --scan"),
        (["run", "w.yaml", "--scan", "somewhere", "--out", "x"], "w.yaml: a workflow and --scan exclude each other"),
        (
            ["simulate", "scan", "--out", "new", "--foot", "right", "--block"],
            "expected one of MESH, --foot and --block",
        ),
        (["simulate", "scan", "--out", "new", "--block", "--patient", "../x"], "--patient: "),
        (["simulate", "scan", "--out", "new", "--block", "--frames", "0"], "--frames"),
        (["simulate", "world", "--out", "new"], "expected one of --seed and --world"),
        (
            ["simulate", "world", "--out", "new", "--seed", "1", "--world", "w.json"],
            "expected one of --seed and --world",
        ),
        (["simulate", "world", "--out", "new", "--world", "w.json"], "w.json: no such file"),
        (["simulate", "world", "--out", "new", "--seed", "-1"], "--seed"),
        (["calibrate", "chart"], "Missing argument"),
        (["calibrate", "chart", "c.csv", "--order", "6"], "--order"),
        (["calibrate", "chart", "c.csv", "--order", "2", "--model", "quadratic"], "--order: "),
        (["measure", "foot.stl", "--side", "both"], "--side"),
        (["extract", "nothing.png"], "nothing.png: no such film"),
    ],
)
def test_wrong_use(
    refuse: Refuse, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert told in refuse(*arguments)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("archive: archive", "archive: nowhere", "archive.0: no such folder, expected one with scans, found 'nowhere'"),
        ("results: results", "result: results", "unknown field, did you mean 'results'?"),
        ("results: results", "results: results\nparameters: {outliers: {z_mm: [9, 1]}}", "parameters.outliers: "),
        ("results: results", "results: results\nparameters: {outlier: {}}", "did you mean 'outliers'?"),
        ("results: results", "results: results\nworkers: many", "workers: "),
        ("workflow/1", "scan/1", "format: "),
    ],
)
def test_broken_workflow(footscan: Footscan, bench: Path, old: str, new: str, told: str) -> None:
    file = bench / "workflow.yaml"
    file.write_text(file.read_text().replace(old, new))
    done = footscan("run", file)
    assert (done.returncode, done.stdout) == (2, "")
    lines = done.stderr.splitlines()
    if len(lines) > 1:
        assert lines.pop() == f"footscan: {file}: {len(lines)} mistakes, see 'footscan config check {file}'"
    assert all(line.startswith(f"footscan: {file}: ") and line.endswith(")") for line in lines), done.stderr
    assert any(told in line for line in lines), done.stderr


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (CHART, "", "is empty"),
        (CHART, CHART.splitlines()[0] + "\n", "has a header but no control point"),
        ("x_mm,y_mm,z_mm", "x_mm,y_cm,z_mm", "line 1: mixes cm and mm"),
        ("x_mm,y_mm,z_mm", "x_in,y_in,z_in", "line 1, column x_in: unknown column"),
        (",i,j\n", ",i\n", "line 1, column j: is missing"),
        ("159,221", "159", "line 2: expected 7 values"),
        ("159", "many", "line 2, column i: expected a number"),
        ("159", "nan", "line 2, column i: expected a number"),
        ("1,P2", "1,P1", "line 3, column point: camera 1 has 'P1' in line 2 already"),
        ("1,P2", "0,P2", "line 3, column camera: expected a whole number from 1"),
        ("P2", "P2\udcff", "expected a CSV file in UTF-8"),
    ],
)
def test_chart_with_a_mistake(refuse: Refuse, tmp_path: Path, old: str, new: str, told: str) -> None:
    chart = tmp_path / "chart.csv"
    chart.write_text(CHART.replace(old, new), errors="surrogateescape")
    line = refuse("calibrate", "chart", chart, "--out", tmp_path / "calibration.json")
    assert line.startswith(f"{chart}: ")
    assert told in line
    assert not (tmp_path / "calibration.json").exists()


def test_chart_that_is_not_there(refuse: Refuse, tmp_path: Path) -> None:
    assert "chart.csv: no such file" in refuse("calibrate", "chart", tmp_path / "chart.csv")


@pytest.mark.parametrize(
    ("rows", "camera", "told"),
    [
        ("i,j\n1,2\n", 9, "cameras: has no camera 9, expected one of 1, 2, 3, 4, 5, 6, 7, 8"),
        ("x,y\n1,2\n", 1, "expected columns i and j"),
        ("i,j\n1,two\n", 1, "line 2, column j: expected a number of pixels, found 'two'"),
        ("i,j\n1\n", 1, "line 2, column j: expected a number of pixels"),
        ("i,j\n1,inf\n", 1, "line 2, column j: "),
        ("", 1, "expected columns i and j"),
        ("i,i,j\n1,2,3\n", 1, "i,i,j"),
    ],
)
def test_pixels_that_cannot_be_mapped(
    refuse: Refuse, measured: Path, tmp_path: Path, rows: str, camera: int, told: str
) -> None:
    points, out = tmp_path / "points.csv", tmp_path / "world.csv"
    points.write_text(rows)
    assert told in refuse("map", measured / "calibration.json", points, "--camera", camera, "--out", out)
    assert not out.exists()


def empty_stl() -> bytes:
    return bytes(84)


def stl(scale: float, mesh: trimesh.Trimesh | None = None) -> bytes:
    foot = make_foot(resolution_mm=4.0)
    mesh = mesh or trimesh.Trimesh(foot.vertices, foot.faces)
    return bytes(mesh.copy().apply_scale(scale).export(file_type="stl"))


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (empty_stl, "holds no points"),
        (lambda: b"", "is no proper STL file"),
        (lambda: b"no mesh at all" * 20, "is no proper STL file"),
        (lambda: stl(1.0)[:-30], "is no proper STL file"),
        (lambda: stl(1.0)[:96] + struct.pack("<f", np.nan) + stl(1.0)[100:], "are no numbers"),
    ],
    ids=["empty", "nothing", "text", "truncated", "NaN"],
)
def test_broken_stl(refuse: Refuse, measured: Path, tmp_path: Path, content: Callable[[], bytes], told: str) -> None:
    broken, sound = tmp_path / "broken.stl", measured / "results/P0001/small/foot.stl"
    broken.write_bytes(content())
    for arguments in (("compare", broken, sound), ("compare", sound, broken), ("measure", broken)):
        line = refuse(*arguments)
        assert line.startswith(f"{broken}: ")
        assert told in line


@pytest.mark.parametrize("scale", [0.01, 1000.0])
def test_a_foot_in_no_unit(refuse: Refuse, tmp_path: Path, scale: float) -> None:
    (tmp_path / "foot.stl").write_bytes(stl(scale))
    line = refuse("measure", tmp_path / "foot.stl", "--out", tmp_path / "measures.json")
    assert line.startswith(f"{tmp_path / 'foot.stl'}: ")
    assert "mm" in line
    assert not (tmp_path / "measures.json").exists()


def test_the_unit_of_a_foot_is_told(footscan: Footscan, tmp_path: Path) -> None:
    (tmp_path / "foot.stl").write_bytes(stl(0.001))
    done = footscan("measure", tmp_path / "foot.stl", "--json")
    assert "coordinates in m, inferred from the length of 0.26" in done.stderr
    assert json.loads(done.stdout)["measures"]["foot_length"]["value"] == pytest.approx(262.0, abs=0.5)


def test_a_sphere_is_no_foot(refuse: Refuse, tmp_path: Path) -> None:
    (tmp_path / "sphere.stl").write_bytes(stl(1.0, trimesh.creation.icosphere(radius=50.0)))
    line = refuse("measure", tmp_path / "sphere.stl")
    assert line.startswith(f"{tmp_path / 'sphere.stl'}: ")
    assert "expected a foot" in line


def test_film_in_another_unit(refuse: Refuse, tmp_path: Path) -> None:
    (tmp_path / "foot.stl").write_bytes(stl(0.001))
    line = refuse("simulate", "scan", tmp_path / "foot.stl", "--out", tmp_path / "scan")
    assert "foot.stl: unit: " in line
    assert "expected 20 to 600 mm" in line
    assert not (tmp_path / "scan").exists()


def test_a_folder_in_use_is_not_filmed_over(refuse: Refuse, measured: Path) -> None:
    scan = measured / "archive/P0001/small"
    assert "is there already" in refuse("simulate", "scan", "--foot", "left", "--out", scan)
    assert "is there already" in refuse("simulate", "capture", "--out", measured / "capture")


@pytest.mark.parametrize("name", ["letter.txt", "letter.png", "letter.jpg", "letter.avi"])
def test_no_picture_to_extract_from(refuse: Refuse, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("a letter\n" * 50)
    line = refuse("extract", tmp_path / name, "--out", tmp_path / "points.csv")
    assert line.startswith(f"{tmp_path / name}: ")
    assert not (tmp_path / "points.csv").exists()


def test_empty_folder_to_extract_from(refuse: Refuse, tmp_path: Path) -> None:
    assert "no PNG or JPEG images in this folder" in refuse("extract", tmp_path)

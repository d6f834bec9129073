"""A scan that breaks its format: one line that says what is wrong, an exit status of its own, and nothing lost."""

import os
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
import simplejpeg
from bench_scan import FRAMES, STEP_MM

from footscan.virtual.filming.film import write_film

Footscan = Callable[..., CompletedProcess[str]]
Mistake = Callable[[CompletedProcess[str]], str]
Results = Callable[[Path], dict[str, bytes]]
Refuse = Callable[[], str]


@pytest.fixture
def scan(bench: Path) -> Path:
    return bench / "archive" / "P0001" / "small"


@pytest.fixture
def refuse(footscan: Footscan, mistake: Mistake, bench: Path, scan: Path, results: Results) -> Refuse:
    """Run the scan of the bench; what is told of it, after a check that no other file of the bench has changed."""

    def run() -> str:
        films = {film: film.read_bytes() for film in scan.glob("*.*") if film.is_file()}
        before = results(bench)
        calibration = ("--calibration", bench / "calibration.json")
        done = footscan("run", "--scan", scan, *calibration, "--out", bench / "results")
        assert done.returncode == 2, done.stderr
        assert done.stdout == ""
        assert results(bench) == before
        assert {film: film.read_bytes() for film in scan.glob("*.*") if film.is_file()} == films
        return mistake(done)

    return run


def grey_film(path: Path, width: int, height: int) -> None:
    picture = simplejpeg.encode_jpeg(np.full((height, width, 3), 40, np.uint8), 85, "RGB", "420")
    write_film(path, [picture] * FRAMES, width, height, 25)


@pytest.mark.parametrize("kept", ["half", "all but 100 bytes", "nothing"])
def test_truncated_film(refuse: Refuse, scan: Path, kept: str) -> None:
    film = scan / "cam4.avi"
    length = film.stat().st_size
    os.truncate(film, {"half": length // 2, "all but 100 bytes": length - 100, "nothing": 0}[kept])
    line = refuse()
    assert str(film) in line
    if kept == "nothing":
        assert "expected an AVI film" in line
    else:
        missing = length - film.stat().st_size
        assert f"length: truncated: {missing} of {length} bytes are missing" in line


def test_missing_film(refuse: Refuse, scan: Path) -> None:
    (scan / "cam3.avi").unlink()
    assert f"{scan / 'cam3.avi'}: no such film" in refuse()


def test_film_of_another_size(refuse: Refuse, scan: Path) -> None:
    grey_film(scan / "cam2.avi", 320, 240)
    line = refuse()
    assert f"{scan / 'cam2.avi'}: frame size: expected frames of 640 x 480 pixels, the size in the camera's " in line
    assert "found 320 x 240" in line


def test_text_instead_of_a_film(refuse: Refuse, scan: Path) -> None:
    (scan / "cam1.avi").write_text("This is a letter to the patient, not a film.\n" * 20)
    assert f"{scan / 'cam1.avi'}: header: expected an AVI film" in refuse()


def test_folder_without_pictures(refuse: Refuse, scan: Path) -> None:
    (scan / "cam1.avi").unlink()
    (scan / "cam1.avi").mkdir()
    assert f"{scan / 'cam1.avi'}: no PNG or JPEG images in this folder" in refuse()


def test_the_films_that_are_well_are_not_read_again(footscan: Footscan, bench: Path, scan: Path) -> None:
    """One film is broken: when it is there again, nothing is left to do."""
    film = scan / "cam4.avi"
    content = film.read_bytes()
    film.write_bytes(content[: len(content) // 2])
    assert footscan("run", bench / "workflow.yaml").returncode == 1
    film.write_bytes(content)
    assert footscan("run", bench / "workflow.yaml").stderr.startswith("0 of 40 steps to run")


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("patient: P0001", "patient: ../../x", "patient: "),
        ("patient: P0001", "patient: ''", "patient: "),
        ("scan: small", f"scan: {'s' * 65}", "scan: "),
        ("scan: small", "scan: small\nscan: big", "line 4, column 1: 'scan' is listed twice"),
        ("side: right", "side: middle", "side: "),
        ("side: right", "side: right\nshoe: 42", "shoe: unknown field"),
        ("side: right", "sied: right", "did you mean 'side'?"),
        ("side: right", "side: [right", "line 5, column 7: expected ',' or ']'"),
        ("side: right", "side: &a [*a, *a]", "line 4, column 11: alias 'a'"),
        ("scan/1", "scan/9", "format: "),
        (f"step_mm: {STEP_MM}", "step_mm: 0", "travel.step_mm: "),
        (f"step_mm: {STEP_MM}", "step_mm: .nan", "travel.step_mm: "),
        (f"step_mm: {STEP_MM}", "step_mm: four", "travel.step_mm: "),
        (f"travel: {{start_mm: 0.0, step_mm: {STEP_MM}}}\n", "", "camera 1 has no travel"),
        ("id: 2,", "id: 1,", "camera 1 is listed twice"),
        ("id: 2,", "id: -2,", "cameras.1.id: "),
        ("file: cam3.avi", "file: /etc/passwd", "cameras.2.file: expected a path relative to this file"),
        ("file: cam3.avi", "file: ../../../../cam3.avi", "file of camera 3: '../../../../cam3.avi' leaves the archive"),
        ("file: cam3.avi", "file: cam3.avi, positions: ../../../p.csv", "positions of camera 3: "),
        ("truth: truth.stl", "truth: ../../../truth.stl", "truth: '../../../truth.stl' leaves the archive"),
        ("truth: truth.stl", "truth: other.stl", "other.stl: no such film"),
    ],
)
def test_broken_scan_yaml(refuse: Refuse, scan: Path, old: str, new: str, told: str) -> None:
    text = (scan / "scan.yaml").read_text()
    assert old in text
    (scan / "scan.yaml").write_text(text.replace(old, new))
    line = refuse()
    assert told in line
    assert line.startswith(str(scan))


@pytest.mark.parametrize("content", [b"", b"- a list\n", b"\xff\xfe\x00", b"a: {" * 50])
def test_scan_yaml_that_is_none(refuse: Refuse, scan: Path, content: bytes) -> None:
    (scan / "scan.yaml").write_bytes(content)
    assert f"{scan / 'scan.yaml'}: " in refuse()


def test_film_that_leaves_the_archive_by_a_link(refuse: Refuse, bench: Path, scan: Path) -> None:
    (scan / "cam6.avi").rename(bench / "elsewhere.avi")
    (scan / "cam6.avi").symlink_to(bench / "elsewhere.avi")
    assert f"{scan / 'scan.yaml'}: file of camera 6: 'cam6.avi' leaves the archive" in refuse()


def test_no_scan_at_all(footscan: Footscan, mistake: Mistake, bench: Path) -> None:
    for folder, told in ((bench / "nowhere", "no such folder"), (bench / "capture", "scan.yaml: no such file")):
        done = footscan("run", "--scan", folder, "--out", bench / "results")
        assert done.returncode == 2
        assert mistake(done).startswith(f"{folder}")
        assert told in mistake(done)


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        (
            "frame,x_mm\n" + "".join(f"{k},{STEP_MM * k}\n" for k in range(FRAMES - 2)),
            f"expected a position for each of {FRAMES} frames",
        ),
        ("frame,x_mm\n0,0\n0,1\n", "line 3: frame 0 is given twice"),
        ("frame,x_mm\n0,nan\n", "line 2: expected a frame number"),
        ("number,x\n0,0\n", "expected the columns frame,x_mm"),
        ("", "expected the columns frame,x_mm"),
    ],
)
def test_broken_positions(refuse: Refuse, scan: Path, rows: str, told: str) -> None:
    text = (scan / "scan.yaml").read_text()
    (scan / "scan.yaml").write_text(text.replace("file: cam3.avi", "file: cam3.avi, positions: cam3.csv"))
    (scan / "cam3.csv").write_text(rows)
    line = refuse()
    assert told in line
    assert "cam3.csv" in line


def test_missing_positions(refuse: Refuse, scan: Path) -> None:
    text = (scan / "scan.yaml").read_text()
    (scan / "scan.yaml").write_text(text.replace("file: cam3.avi", "file: cam3.avi, positions: cam3.csv"))
    assert f"{scan / 'cam3.csv'}: no such file" in refuse()


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"footscan.calibration/4"', '"footscan.calibration/7"', "format: expected version 1 to 4, found 'footscan.c"),
        ('"camera": 3,', '"camera": 33,', "cameras: has no camera 3, expected one of 1, 2, 33, 4"),
        ('"camera": 3,', '"camera": 2,', "expected each camera once"),
        ('"scale_px": ', '"scale_px": NaN, "x": ', "expected a JSON document (NaN is no JSON number)"),
        ('"scale_px": ', '"scale_px": -', "cameras.0.map.homography.scale_px: "),
        (
            '"scale_px": ',
            '"scales_px": ',
            "cameras.0.map.homography.scales_px: unknown field, did you mean 'scale_px'?",
        ),
        ('"matrix": ', '"matrx": ', "cameras.0.map.homography.matrx: unknown field, did you mean 'matrix'?"),
        ("{", "", "expected a JSON document"),
    ],
)
def test_broken_calibration(refuse: Refuse, bench: Path, old: str, new: str, told: str) -> None:
    file = bench / "calibration.json"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    line = refuse()
    assert told in line
    assert str(file) in line


def test_missing_calibration(refuse: Refuse, bench: Path) -> None:
    (bench / "calibration.json").unlink()
    assert f"{bench / 'calibration.json'}: no such file" in refuse()


def test_no_calibration_named(footscan: Footscan, mistake: Mistake, bench: Path, scan: Path) -> None:
    done = footscan("run", "--scan", scan, "--out", bench / "results")
    assert done.returncode == 2
    assert f"{scan / 'scan.yaml'}: calibration: names no calibration" in mistake(done)


def test_plan_says_the_same(footscan: Footscan, mistake: Mistake, bench: Path, scan: Path) -> None:
    (scan / "scan.yaml").write_text("patient: ../../x\n")
    done = footscan("plan", "--scan", scan, "--calibration", bench / "calibration.json", "--out", bench / "results")
    assert done.returncode == 2
    assert str(scan / "scan.yaml") in mistake(done)

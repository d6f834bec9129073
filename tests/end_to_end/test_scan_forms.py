"""The forms that a recorded scan may take, and archives of several scans."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import av
import numpy as np
import pytest
import simplejpeg
from bench_scan import FRAMES, STEP_MM

from footscan.virtual.filming.film import write_film

Footscan = Callable[..., CompletedProcess[str]]
Mistake = Callable[[CompletedProcess[str]], str]
Results = Callable[[Path], dict[str, bytes]]


def edit(scan: Path, old: str, new: str) -> None:
    text = (scan / "scan.yaml").read_text()
    assert old in text
    (scan / "scan.yaml").write_text(text.replace(old, new))


def run(footscan: Footscan, bench: Path) -> dict[str, Any]:
    done = footscan("run", bench / "workflow.yaml", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_seven_cameras_are_a_scan(footscan: Footscan, bench: Path) -> None:
    edit(bench / "archive/P0001/small", "- {id: 6, file: cam6.avi}\n", "")
    assert run(footscan, bench)["steps"] == 37
    folder = bench / "results/P0001/small"
    quality = json.loads((folder / "quality.json").read_bytes())
    assert [camera["camera"] for camera in quality["cameras"]] == [1, 2, 3, 4, 5, 7, 8]
    measures = json.loads((folder / "measures.json").read_bytes())["measures"]
    assert measures["foot_length"]["value"] == pytest.approx(262.0, abs=3.0)
    assert quality["truth"]["mean"] < 0.35


def test_a_folder_of_pictures_is_a_film(footscan: Footscan, bench: Path, results: Results) -> None:
    """The pictures are the packets of the film, so the frames are the same to the byte, and so is all that follows."""
    before = results(bench)
    scan = bench / "archive/P0001/small"
    (scan / "cam5").mkdir()
    with av.open(scan / "cam5.avi") as film:
        packets = [bytes(packet) for packet in film.demux(video=0) if packet.size]
    assert len(packets) == FRAMES
    for number, packet in enumerate(packets):
        (scan / "cam5" / f"{number:04}.jpg").write_bytes(packet)
    edit(scan, "file: cam5.avi", "file: cam5/")
    (scan / "cam5.avi").unlink()
    assert run(footscan, bench)["ran"] == 1
    assert results(bench) == before


def test_positions_and_own_travel_stand_for_the_travel(footscan: Footscan, bench: Path, results: Results) -> None:
    before = results(bench)
    scan = bench / "archive/P0001/small"
    edit(scan, "file: cam3.avi", "file: cam3.avi, positions: cam3.csv")
    edit(scan, "file: cam2.avi", f"file: cam2.avi, travel: {{start_mm: 0.0, step_mm: {STEP_MM}}}")
    edit(scan, f"travel: {{start_mm: 0.0, step_mm: {STEP_MM}}}\ntruth", "truth")
    for camera in (1, 4, 5, 6, 7, 8):
        edit(scan, f"file: cam{camera}.avi", f"file: cam{camera}.avi, travel: {{start_mm: 0, step_mm: {STEP_MM}}}")
    rows = "".join(f"{frame},{STEP_MM * frame}\n" for frame in reversed(range(FRAMES)))
    (scan / "cam3.csv").write_text("frame,x_mm\n" + rows)
    assert run(footscan, bench)["ran"] == 1  # camera 3 is mapped again, to the same points
    assert results(bench) == before


def test_another_travel_moves_the_points(footscan: Footscan, bench: Path) -> None:
    edit(bench / "archive/P0001/small", "start_mm: 0.0", "start_mm: 10")
    before = json.loads((bench / "results/P0001/small/measures.json").read_bytes())
    run(footscan, bench)
    after = json.loads((bench / "results/P0001/small/measures.json").read_bytes())
    assert after["transform"][0][3] == pytest.approx(before["transform"][0][3] - 10.0, abs=0.2)
    assert after["measures"]["foot_length"]["value"] == pytest.approx(
        before["measures"]["foot_length"]["value"], abs=0.2
    )
    quality = json.loads((bench / "results/P0001/small/quality.json").read_bytes())
    assert quality["truth"]["max"] > 5.0  # the truth has not moved


def test_the_scans_own_calibration_wins(footscan: Footscan, mistake: Mistake, bench: Path) -> None:
    edit(bench / "archive/P0001/small", "side: right", "side: right\ncalibration: ../other.json")
    (bench / "archive/P0001/other.json").write_bytes((bench / "calibration.json").read_bytes())
    (bench / "calibration.json").unlink()
    assert run(footscan, bench)["ran"] == 3  # quality, quality.json and report, which name the calibration
    assert "other.json" in (bench / "results/P0001/small/report.html").read_text()
    (bench / "archive/P0001/other.json").unlink()
    done = footscan("run", bench / "workflow.yaml")
    assert done.returncode == 1
    assert "other.json: no such file" in mistake(done)


@pytest.fixture
def archive(bench: Path) -> Path:
    """The bench with two more patients, of the same films."""
    first = bench / "archive/P0001/small"
    for patient in ("P0002", "P0003"):
        scan = bench / "archive" / patient / "small"
        shutil.copytree(first, scan, ignore=shutil.ignore_patterns("frames.zarr"))
        edit(scan, "patient: P0001", f"patient: {patient}")
    return bench


def test_one_broken_scan_of_three_costs_itself_alone(footscan: Footscan, mistake: Mistake, archive: Path) -> None:
    film = archive / "archive/P0002/small/cam7.avi"
    film.write_bytes(film.read_bytes()[:100_000])
    done = footscan("run", archive / "workflow.yaml", "--json")
    assert done.returncode == 1
    line = mistake(done)
    assert f"{film}: " in line
    assert "truncated" in line
    document = json.loads(done.stdout)
    assert [(scan["scan"], scan["status"]) for scan in document["scans"]] == [
        ("P0001/small", "done"),
        ("P0002/small", "refused"),
        ("P0003/small", "done"),
    ]
    assert not (archive / "results/P0002").exists()
    first, third = (archive / "results" / patient / "small" for patient in ("P0001", "P0003"))
    for name in ("cloud.ply", "foot.stl", "measures.json", "quality.json"):
        assert (first / name).read_bytes() == (third / name).read_bytes()  # the same films, once computed
    assert "P0003" in (third / "report.html").read_text()
    again = footscan("run", archive / "workflow.yaml", "--json")
    assert again.returncode == 1
    assert json.loads(again.stdout)["ran"] == 0  # a film that cannot be read is not read again either
    assert mistake(again) == line


def test_a_scan_that_breaks_its_format_costs_itself_alone(footscan: Footscan, mistake: Mistake, archive: Path) -> None:
    (archive / "archive/P0002/small/scan.yaml").write_text("patient: [")
    planned = footscan("plan", archive / "workflow.yaml", "--json")
    assert planned.returncode == 1
    assert json.loads(planned.stdout)["steps"] == 80
    done = footscan("run", archive / "workflow.yaml")
    assert done.returncode == 1
    assert mistake(done).startswith(f"{archive / 'archive/P0002/small/scan.yaml'}: line 1")
    assert {line.split(":")[0] for line in done.stdout.splitlines()} == {"P0001/small", "P0003/small"}


def test_two_scans_of_one_name_are_not_mixed(footscan: Footscan, mistake: Mistake, archive: Path) -> None:
    shutil.rmtree(archive / "archive/P0003")
    edit(archive / "archive/P0002/small", "patient: P0002", "patient: P0001")
    done = footscan("run", archive / "workflow.yaml")
    assert done.returncode == 1
    assert f"P0001/small is also in {archive / 'archive/P0001/small'}" in mistake(done)
    assert done.stdout.startswith("P0001/small: ")


def test_films_without_a_foot_are_a_finding(footscan: Footscan, mistake: Mistake, fresh: Path) -> None:
    """Nothing is wrong with the files: the scan is done, and failed, and is not run again."""
    picture = simplejpeg.encode_jpeg(np.full((480, 640, 3), 40, np.uint8), 85, "RGB", "420")
    for camera in range(1, 9):
        write_film(fresh / f"archive/P0001/small/cam{camera}.avi", [picture] * 10, 640, 480, 25)
    for again in (False, True):
        done = footscan("run", fresh / "workflow.yaml", "--json")
        assert done.returncode == 1
        assert "P0001/small: no stripe in any camera" in mistake(done)
        assert (json.loads(done.stdout)["ran"] == 0) == again
        assert json.loads(done.stdout)["scans"][0]["status"] == "finding"
    assert not (fresh / "results/P0001").exists()


def test_an_empty_archive_is_told(footscan: Footscan, mistake: Mistake, bench: Path) -> None:
    shutil.rmtree(bench / "archive")
    (bench / "archive").mkdir()
    done = footscan("run", bench / "workflow.yaml")
    assert done.returncode == 2
    assert f"{bench / 'workflow.yaml'}: archive: " in mistake(done)

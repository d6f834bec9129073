"""Films into frames and into stripe points, by hand."""

import csv
import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import av
import numpy as np
import pytest
import zarr
from bench_scan import FRAMES

from tests.helpers.stored_frames import frames_of

Footscan = Callable[..., CompletedProcess[str]]
Mistake = Callable[[CompletedProcess[str]], str]
COLUMNS = ["frame", "i", "j", "width", "peak", "score"]


def test_ingest_keeps_the_cameras_bytes(footscan: Footscan, fresh: Path) -> None:
    scan = fresh / "archive/P0001/small"
    done = footscan("ingest", scan, "--json")
    assert done.returncode == 0
    assert done.stderr == ""
    ends = json.loads(done.stdout)
    assert [(end["scan"], end["camera"], end["frames"], end["lost"]) for end in ends] == [
        ("P0001/small", camera, FRAMES, 0) for camera in range(1, 9)
    ]
    films = sum(file.stat().st_size for file in scan.glob("*.avi"))
    store = sum(file.stat().st_size for file in (scan / "frames.zarr").rglob("*") if file.is_file())
    print(f"store of {store / films:.4f} times the films")
    assert sum(end["film_bytes"] for end in ends) == films
    assert store <= 1.05 * films
    with av.open(scan / "cam3.avi") as film:
        packets = [bytes(packet) for packet in film.demux(video=0) if packet.size]
    assert frames_of(scan / "frames.zarr/cam3") == packets
    assert sum(file.is_file() for file in scan.rglob("*")) <= 8 + 20  # films, and all else of a scan
    group = zarr.open_group(str(scan / "frames.zarr"), mode="r")
    assert sorted(group.array_keys()) == [f"cam{camera}" for camera in range(1, 9)]
    assert group["cam3"].shape == (FRAMES, 480, 640, 3)
    assert np.asarray(group["cam3"][40]).max() == 255  # a laser's core


def test_ingest_again_and_of_an_archive(footscan: Footscan, bench: Path) -> None:
    frames = bench / "archive/P0001/small/frames.zarr"
    before = {file: file.read_bytes() for file in frames.rglob("*") if file.is_file()}
    done = footscan("ingest", bench / "archive")
    assert done.returncode == 0
    assert done.stdout.count(" ok ") == 8
    assert {file: file.read_bytes() for file in frames.rglob("*") if file.is_file()} == before


def test_ingest_tells_of_a_film_that_is_broken(footscan: Footscan, mistake: Mistake, bench: Path) -> None:
    film = bench / "archive/P0001/small/cam8.avi"
    os.truncate(film, 50_000)
    frames = film.parent / "frames.zarr/cam8"
    before = {file.name: file.read_bytes() for file in frames.iterdir()}
    done = footscan("ingest", film.parent, "--json")
    assert done.returncode == 2
    assert mistake(done).startswith(f"{film}: length: truncated")
    assert [end["problem"] is None for end in json.loads(done.stdout)] == [True] * 7 + [False]
    assert {file.name: file.read_bytes() for file in frames.iterdir()} == before  # the frames that were there


def test_ingest_of_nothing(footscan: Footscan, mistake: Mistake, tmp_path: Path) -> None:
    done = footscan("ingest", tmp_path / "nowhere")
    assert done.returncode == 2
    assert "nowhere: no such folder" in mistake(done)


def rows_of(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as text:
        rows = csv.DictReader(text)
        assert rows.fieldnames == COLUMNS
        return list(rows)


def test_extract_a_film_a_folder_and_a_picture(footscan: Footscan, measured: Path, tmp_path: Path) -> None:
    film = measured / "archive/P0001/small/cam1.avi"
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for number, frame in enumerate(frames_of(film.parent / "frames.zarr/cam1")):
        (pictures / f"{number:03}.jpg").write_bytes(frame or b"")
    for source, name in ((film, "film.csv"), (pictures, "folder.csv")):
        done = footscan("extract", source, "--out", tmp_path / name)
        assert (done.returncode, done.stdout) == (0, "")
    assert (tmp_path / "film.csv").read_bytes() == (tmp_path / "folder.csv").read_bytes()
    rows = rows_of(tmp_path / "film.csv")
    assert all(re.fullmatch(r"\d+\.\d{3}", row[name]) for row in rows for name in COLUMNS[1:])
    assert {int(row["frame"]) for row in rows} <= set(range(FRAMES))
    of_the_run = json.loads((measured / "results/P0001/small/quality.json").read_bytes())["cameras"][0]
    assert len(rows) == of_the_run["points"]

    done = footscan("extract", pictures / "040.jpg", "--out", tmp_path / "picture.csv", "--json")
    picture = rows_of(tmp_path / "picture.csv")
    assert json.loads(done.stdout)["points"] == len(picture) > 100
    places = {(row["i"], row["j"]) for row in picture}
    assert {(row["i"], row["j"]) for row in rows if row["frame"] == "40"} <= places
    printed = footscan("extract", pictures / "040.jpg")
    assert printed.stdout == (tmp_path / "picture.csv").read_text()


def test_extract_a_real_photograph(footscan: Footscan, tmp_path: Path) -> None:
    """A laser line down a turning object: bright red, hardly wider than a few pixels, from top to bottom."""
    photograph = Path(os.environ.get("FOOTSCAN_DATA", "")) / "ciclop/object/laser.png"
    if not photograph.is_file():
        pytest.skip("FOOTSCAN_DATA names no folder with ciclop/object/laser.png")
    done = footscan("extract", photograph, "--out", tmp_path / "points.csv")
    assert done.returncode == 0
    rows = rows_of(tmp_path / "points.csv")
    i, j = (np.array([float(row[name]) for row in rows]) for name in "ij")
    print(f"{len(rows)} points, i {i.min():.0f} to {i.max():.0f}, j {j.min():.0f} to {j.max():.0f}")
    assert len(rows) > 100

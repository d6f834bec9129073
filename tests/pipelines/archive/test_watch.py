"""Scans are reported once they are complete, and again only after a change."""

import os
import shutil
import time
from pathlib import Path
from typing import Any

import pytest

from footscan.recordings.scans import RecordedScan, read_scan
from pipelines.archive.watch import QUIET_S, Arrivals


@pytest.fixture
def arriving(archive: Any, tmp_path: Path) -> tuple[Path, Path]:
    """An empty archive, and a scan that is not in it yet."""
    empty = tmp_path / "arriving"
    empty.mkdir()
    return empty, archive.scan


def age(folder: Path, seconds: float = 2 * QUIET_S) -> None:
    """Make all files older than `QUIET_S`."""
    for path in folder.rglob("*"):
        if path.is_file():
            os.utime(path, (time.time() - seconds,) * 2)


def test_nothing_is_there_yet(arriving: tuple[Path, Path]) -> None:
    assert Arrivals((arriving[0],)).complete() == []


def test_a_scan_waits_until_its_last_film_is_there_and_quiet(arriving: tuple[Path, Path]) -> None:
    archive, scan = arriving
    folder = archive / "P0001/S1"
    arrivals = Arrivals((archive,))
    shutil.copytree(scan, folder, ignore=shutil.ignore_patterns("cam5.avi", "frames.zarr"))
    age(folder)
    assert arrivals.complete() == []
    film = (scan / "cam5.avi").read_bytes()
    (folder / "cam5.avi").write_bytes(film[: len(film) // 2])  # still being copied
    assert arrivals.complete() == []
    (folder / "cam5.avi").write_bytes(film)
    assert arrivals.complete() == []
    age(folder)
    assert arrivals.complete() == [folder]
    assert arrivals.complete() == []


def test_a_scan_waits_for_the_check_that_it_carries(arriving: tuple[Path, Path]) -> None:
    archive, scan = arriving
    folder = archive / "P0001/S1"
    shutil.copytree(scan, folder)
    document = folder / "scan.yaml"
    document.write_text(document.read_text().replace("cameras:", "calibration_check: check.json\ncameras:"))
    age(folder)
    arrivals = Arrivals((archive,))
    assert arrivals.complete() == []
    (folder / "check.json").write_text("{}")
    age(folder)
    assert arrivals.complete() == [folder]


def test_a_scan_that_changes_comes_again(arriving: tuple[Path, Path]) -> None:
    archive, scan = arriving
    folder = archive / "P0001/S1"
    shutil.copytree(scan, folder)
    age(folder)
    arrivals = Arrivals((archive,))
    assert arrivals.complete() == [folder]
    document = folder / "scan.yaml"
    document.write_text(document.read_text() + "# a remark\n")
    assert arrivals.complete() == []
    age(folder, 3 * QUIET_S)
    assert arrivals.complete() == [folder]


def test_films_of_a_clock_that_is_ahead_are_quiet_once_they_stay_as_they_are(
    arriving: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    archive, scan = arriving
    folder = archive / "P0001/S1"
    shutil.copytree(scan, folder)
    age(folder, -86400)
    clock = 100.0
    monkeypatch.setattr("pipelines.archive.watch.time.monotonic", lambda: clock)
    arrivals = Arrivals((archive,))
    assert arrivals.complete() == []
    clock += 0.9 * QUIET_S
    film = folder / "cam5.avi"
    film.write_bytes(film.read_bytes() + b"more")
    age(folder, -86400)
    assert arrivals.complete() == []
    clock += 0.9 * QUIET_S
    assert arrivals.complete() == []
    clock += 0.2 * QUIET_S
    assert arrivals.complete() == [folder]
    assert arrivals.complete() == []


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The folders whose scan.yaml was read, in order."""
    read: list[Path] = []

    def counted(folder: Path, archive: Path | None = None) -> RecordedScan:
        read.append(folder)
        return read_scan(folder, archive)

    monkeypatch.setattr("pipelines.archive.watch.read_scan", counted)
    return read


def test_a_document_is_read_once_until_it_changes(arriving: tuple[Path, Path], reads: list[Path]) -> None:
    archive, scan = arriving
    good, waiting, broken = (archive / "P0001" / name for name in ("S1", "S2", "S3"))
    shutil.copytree(scan, good)
    shutil.copytree(scan, waiting, ignore=shutil.ignore_patterns("cam5.avi", "frames.zarr"))
    broken.mkdir()
    (broken / "scan.yaml").write_text("side: [right")
    age(archive)
    arrivals = Arrivals((archive,))
    assert arrivals.complete() == [good, broken]
    for _ in range(5):
        assert arrivals.complete() == []
    assert reads == [good, waiting, broken]

    shutil.copy(scan / "cam5.avi", waiting)
    age(waiting)
    for document in (good / "scan.yaml", broken / "scan.yaml"):
        replaced = document.with_suffix(".new")  # equal in size and time, but another file
        replaced.write_bytes(document.read_bytes())
        status = document.stat()
        os.utime(replaced, ns=(status.st_atime_ns, status.st_mtime_ns))
        replaced.replace(document)
    assert arrivals.complete() == [waiting]
    assert reads[3:] == [good, waiting, broken]  # `age` has touched that of the second
    assert arrivals.complete() == []
    assert len(reads) == 6


def test_a_document_that_was_just_written_is_read_again(arriving: tuple[Path, Path], reads: list[Path]) -> None:
    archive, scan = arriving
    folder = archive / "P0001/S1"
    shutil.copytree(scan, folder)
    document = folder / "scan.yaml"
    document.write_text(document.read_text())
    arrivals = Arrivals((archive,))
    assert arrivals.complete() == arrivals.complete() == []
    assert reads == [folder, folder]
    age(folder)
    assert arrivals.complete() == [folder]
    assert arrivals.complete() == []
    assert reads == [folder] * 3


def test_a_broken_document_is_handed_over_to_be_refused(arriving: tuple[Path, Path]) -> None:
    archive, _ = arriving
    folder = archive / "P0001/S1"
    folder.mkdir(parents=True)
    (folder / "scan.yaml").write_text("side: [right")
    age(folder)
    assert Arrivals((archive,)).complete() == [folder]

"""Recorded scans in an archive."""

from pathlib import Path
from typing import Any

import pytest

from footscan.recordings.scans import read_scan, scan_folders
from schemas.base.errors import RefusedInput


def test_paths_of_a_scan(archive: Any) -> None:
    document = archive.scan / "scan.yaml"
    text = document.read_text().replace("cam5.avi", "cam5.avi, positions: x/cam5.csv")
    document.write_text(text.replace("cameras:", "calibration: ../calibration.json\ntruth: truth.stl\ncameras:"))
    scan = read_scan(archive.scan)
    assert scan.name == "P0001/S1"
    assert (scan.folder, scan.archive) == (archive.scan, archive.root / "archive")
    assert scan.calibration == archive.scan.parent / "calibration.json"
    assert scan.truth == archive.scan / "truth.stl"
    one, five = scan.document.cameras
    assert (scan.film(one), scan.positions(one)) == (archive.scan / "cam1.avi", None)
    assert scan.positions(five) == archive.scan / "x/cam5.csv"


@pytest.mark.parametrize("path", ["../../../x.avi", "link/x.avi"])
@pytest.mark.parametrize("field", ["file", "positions"])
def test_paths_that_leave_the_archive_are_refused_at_once(archive: Any, path: str, field: str) -> None:
    (archive.scan / "link").symlink_to(archive.root)
    document = archive.scan / "scan.yaml"
    new = f"file: {path}" if field == "file" else f"file: cam5.avi, positions: {path}"
    document.write_text(document.read_text().replace("file: cam5.avi", new))
    with pytest.raises(RefusedInput) as caught:
        read_scan(archive.scan)
    assert caught.value.field == f"{field} of camera 5"
    assert "leaves the archive" in caught.value.problem
    read_scan(archive.scan, archive.root.parent)  # in a larger archive it is inside


@pytest.mark.parametrize("field", ["calibration", "truth"])
def test_other_paths_are_refused_where_they_are_asked_for(archive: Any, field: str) -> None:
    document = archive.scan / "scan.yaml"
    document.write_text(document.read_text().replace("cameras:", f"{field}: ../../../x\ncameras:"))
    with pytest.raises(RefusedInput, match=f"{field}: '../../../x' leaves the archive"):
        getattr(read_scan(archive.scan), field)


def test_scans_are_found_in_order(tmp_path: Path) -> None:
    for folder in ("P2/b", "P1/a", "P10/x", "P1/a/frames"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "scan.yaml").touch()
    (tmp_path / "P3/empty").mkdir(parents=True)
    assert [str(folder.relative_to(tmp_path)) for folder in scan_folders(tmp_path)] == ["P1/a", "P10/x", "P2/b"]
    with pytest.raises(RefusedInput, match="expected an archive of scans"):
        list(scan_folders(tmp_path / "missing"))
    with pytest.raises(RefusedInput, match="no such folder, expected a recorded scan"):
        read_scan(tmp_path / "missing")

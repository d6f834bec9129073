"""Ingest of scans by a command."""

from typing import Any

from pipelines.archive.ingest import ingest_scans


def test_archive_is_ingested_camera_by_camera(archive: Any) -> None:
    (archive.scan / "cam5.avi").write_bytes(b"RIFF")
    [camera_1, camera_5] = ingest_scans([archive.root / "archive"])
    assert (camera_1.scan, camera_1.camera, camera_1.problem) == ("P0001/S1", 1, None)
    assert (camera_1.frames, camera_1.lost) == (20, 0)
    assert camera_1.film_bytes == (archive.scan / "cam1.avi").stat().st_size
    array = archive.scan / "frames.zarr/cam1"
    assert camera_1.store_bytes == sum(path.stat().st_size for path in array.iterdir())
    assert camera_1.store_bytes <= 1.05 * camera_1.film_bytes
    assert (camera_5.camera, camera_5.frames) == (5, 0)
    assert camera_5.problem == f"{archive.scan / 'cam5.avi'}: header: expected an AVI film"
    assert ingest_scans([archive.scan])[0] == camera_1


def test_what_is_no_scan_is_said(archive: Any) -> None:
    [end] = ingest_scans([archive.root / "missing"])
    assert end.problem == f"{archive.root / 'missing'}: no such folder, expected a recorded scan"
    (archive.scan / "scan.yaml").write_text("[")
    [end] = ingest_scans([archive.root / "archive"])
    assert end.camera is None
    assert end.problem is not None
    assert "scan.yaml: line 1, column 2: " in end.problem

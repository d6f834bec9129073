"""Ingest of scans by a command."""

from typing import Any

from pipelines.archive.ingest import ingest_scans


def test_archive_is_ingested_camera_by_camera(archive: Any) -> None:
    (archive.scan / "cam5.avi").write_bytes(b"RIFF")
    [one, five] = ingest_scans([archive.root / "archive"])
    assert (one.scan, one.camera, one.frames, one.lost, one.problem) == ("P0001/S1", 1, 20, 0, None)
    assert one.film_bytes == (archive.scan / "cam1.avi").stat().st_size
    array = archive.scan / "frames.zarr/cam1"
    assert one.store_bytes == sum(path.stat().st_size for path in array.iterdir())
    assert one.store_bytes <= 1.05 * one.film_bytes
    assert (five.camera, five.frames) == (5, 0)
    assert five.problem == f"{archive.scan / 'cam5.avi'}: header: expected an AVI film"
    assert ingest_scans([archive.scan])[0] == one


def test_what_is_no_scan_is_said(archive: Any) -> None:
    [end] = ingest_scans([archive.root / "missing"])
    assert end.problem == f"{archive.root / 'missing'}: no such folder, expected a recorded scan"
    (archive.scan / "scan.yaml").write_text("[")
    [end] = ingest_scans([archive.root / "archive"])
    assert end.camera is None
    assert end.problem is not None
    assert "scan.yaml: line 1, column 2: " in end.problem

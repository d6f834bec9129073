"""Worlds written into folders."""

from pathlib import Path

import numpy as np

from footscan.calibration.travel.body import standard_body
from footscan.recordings.scans import read_scan
from footscan.virtual.optics.scene import Mesh
from pipelines.worlds.export import write_films, write_points
from schemas.base.json_files import read_json
from schemas.calibration import Calibration
from schemas.world import World, WorldCameras

FEW = World(seed=7, cameras=WorldCameras(frames=8, step_mm=50.0, missing=[2, 3, 4, 5, 6, 7]))


def test_films_of_a_world_are_a_scan_that_is_ready_to_run(tmp_path: Path) -> None:
    write_films(FEW, tmp_path / "world")
    scan = read_scan(tmp_path / "world")
    assert [camera.id for camera in scan.document.cameras] == [1, 8]
    assert all(scan.film(camera).stat().st_size > 10_000 for camera in scan.document.cameras)
    assert scan.calibration is not None
    assert [camera.camera for camera in read_json(scan.calibration, Calibration).cameras] == [1, 8]
    assert read_json(tmp_path / "world/world.json", World) == FEW


def test_films_of_a_body_are_of_the_same_scanner(tmp_path: Path) -> None:
    body = standard_body()
    write_films(FEW, tmp_path / "world", body=Mesh(body.vertices, body.faces))
    write_films(FEW, tmp_path / "foot")
    assert read_scan(tmp_path / "world").document.scan == "7-body"
    for name in ("chart.csv", "world.json"):
        assert (tmp_path / "world" / name).read_bytes() == (tmp_path / "foot" / name).read_bytes()
    assert (tmp_path / "world/cam1.avi").read_bytes() != (tmp_path / "foot/cam1.avi").read_bytes()


def test_points_of_a_world_are_tables(tmp_path: Path) -> None:
    write_points(FEW, tmp_path)
    table = np.genfromtxt(tmp_path / "cam1.csv", delimiter=",", names=True)
    assert table.dtype.names == ("frame", "i", "j", "width", "peak", "score")
    assert set(np.unique(table["frame"])) <= set(range(8))
    assert not list(tmp_path.glob("*.avi"))

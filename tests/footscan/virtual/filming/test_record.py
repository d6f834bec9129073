"""A recorded scan follows its format, and its bytes depend on its settings alone."""

from pathlib import Path

import av
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from footscan.virtual.filming.record import ScanExtras, ScanName, record_scan
from footscan.virtual.optics.scanner import standard_scanner
from footscan.virtual.optics.scene import Mesh
from schemas.base.errors import RefusedInput
from schemas.base.yaml_files import read_yaml
from schemas.parameters.simulation import SimulationSettings
from schemas.scan import Scan

SETTINGS = SimulationSettings(start_mm=80.0, step_mm=60.0, frames=2)
LOAF = trimesh.creation.box(bounds=[[10.0, -40.0, 0.0], [210.0, 40.0, 50.0]])
MESH = Mesh(np.asarray(LOAF.vertices), np.asarray(LOAF.faces))


def record(folder: Path, settings: SimulationSettings = SETTINGS, workers: int = 1) -> dict[str, bytes]:
    record_scan(
        MESH,
        folder,
        ScanName("P0001", "2026-11-20-R", "right"),
        settings,
        extras=ScanExtras(stripe_truth=True),
        workers=workers,
    )
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scan")
    record(folder)
    return folder


def test_scan_follows_the_format(folder: Path) -> None:
    scan = read_yaml(folder / "scan.yaml", Scan)
    assert [camera.id for camera in scan.cameras] == list(range(1, 9))
    assert scan.travel is not None
    assert (scan.travel.start_mm, scan.travel.step_mm) == (80.0, 60.0)
    for camera in scan.cameras:
        with av.open(folder / camera.file) as film:
            stream = film.streams.video[0]
            assert (stream.codec_context.name, stream.frames, stream.width, stream.height) == ("mjpeg", 2, 640, 480)
            assert len(list(film.decode(stream))) == 2
    truth = trimesh.load_mesh(folder / "truth.stl")
    np.testing.assert_allclose(truth.bounds, [[10.0, -40.0, 0.0], [210.0, 40.0, 50.0]], atol=1e-5)
    assert truth.volume == pytest.approx(200 * 80 * 50, rel=1e-6)


@pytest.mark.slow
def test_workers_do_not_change_bytes_but_seeds_do(folder: Path, tmp_path: Path) -> None:
    alone = {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
    assert record(tmp_path / "shared", workers=2) == alone
    other = record(tmp_path / "other", SETTINGS.model_copy(update={"seed": 2}))
    assert other["cam1.avi"] != alone["cam1.avi"]
    assert other["truth/cam1.csv"] == alone["truth/cam1.csv"]


def test_laser_off_is_a_second_exposure(folder: Path, tmp_path: Path) -> None:
    record_scan(
        MESH,
        tmp_path,
        ScanName("P0001", "off", "right"),
        SETTINGS,
        extras=ScanExtras(laser_off=True),
        workers=1,
    )
    cameras = read_yaml(tmp_path / "scan.yaml", Scan).cameras
    assert [camera.background for camera in cameras] == [f"cam{camera}-off.avi" for camera in range(1, 9)]
    assert (tmp_path / "cam1.avi").read_bytes() == (folder / "cam1.avi").read_bytes()
    on, off = pictures(tmp_path / "cam1.avi"), pictures(tmp_path / "cam1-off.avi")
    assert on.shape == off.shape == (2, 480, 640, 3)
    redness = on[..., 0] - on[..., 1:].max(axis=-1)
    without = off[..., 0] - off[..., 1:].max(axis=-1)
    stripe = redness > 60
    assert (stripe.sum(axis=(1, 2)) > 500).all()
    assert not (without > 60).any()
    # What the room lights is there both times, with another noise: that of two exposures is sqrt(2) that of one.
    dark = ~stripe & (on.max(axis=-1) < 100)
    difference = (on - off)[dark]
    assert abs(np.median(difference)) <= 2
    assert 0.5 < difference[:, 1].std() < 6


def pictures(film: Path) -> NDArray[np.int_]:
    """(frames, rows, columns, 3) as wide as differences need."""
    with av.open(film) as container:
        return np.array([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)], np.int_)


def test_stripe_truth_lies_on_the_object(folder: Path) -> None:
    for camera in standard_scanner(SETTINGS.scanner_seed).cameras:
        rows = np.loadtxt(folder / "truth" / f"cam{camera.id}.csv", delimiter=",", skiprows=1)
        frame, i, j, x, y, z = rows.T
        np.testing.assert_allclose(x, 80.0 + 60.0 * frame)
        on_side = np.isclose(np.abs(y), 40.0, atol=1e-3)
        on_top, on_sole = np.isclose(z, 50.0, atol=1e-3), np.isclose(z, 0.0, atol=1e-3)
        assert (on_side | on_top | on_sole).all()
        np.testing.assert_allclose(camera.project_plane(y, z), np.column_stack([i, j]), atol=0.01)
        left = camera.id in (1, 2, 5, 6)
        assert not (on_side & ((y > 0) != left)).any()  # no camera sees through the box
        assert on_top.any() == (camera.id <= 4)
        assert on_sole.any() == (camera.id >= 5)


def test_refuses_a_patient_that_is_a_path(tmp_path: Path) -> None:
    with pytest.raises(RefusedInput, match="patient"):
        record_scan(MESH, tmp_path / "x", ScanName("../x", "s", "left"), SETTINGS)
    assert not (tmp_path / "x").exists()

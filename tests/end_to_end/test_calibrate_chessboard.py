"""`footscan calibrate chessboard` on pictures of the virtual scanner, and on folders that break the format."""

import copy
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from bench_scan import run_footscan
from scipy.spatial.transform import Rotation
from shared_folders import MadeOnce

from footscan.calibration.models.maps import is_supported, to_world
from footscan.virtual.chessboard.record import HeadTurn, record_chessboard
from footscan.virtual.optics.scanner import standard_scanner
from schemas.calibration import read_calibration
from schemas.parameters.simulation import SimulationSettings

CAMERAS = (1, 6)
"""One above, and one below the glass."""
TURN_DEG = 1.0


def film_boards(folder: Path) -> None:
    record_chessboard(folder, settings=SimulationSettings(), cameras=CAMERAS, held=12, with_laser=8)


def film_turned(folder: Path) -> None:
    turn = HeadTurn(Rotation.from_euler("z", TURN_DEG, degrees=True).as_matrix(), np.zeros(3))
    record_chessboard(
        folder, settings=SimulationSettings(), cameras=CAMERAS[:1], held=12, with_laser=8, turns={1: turn}
    )


@pytest.fixture(scope="module")
def boards(films: MadeOnce) -> Path:
    """To be read only."""
    return films("boards", film_boards)


@pytest.fixture
def change(boards: Path, tmp_path: Path) -> Callable[[Callable[[dict[str, Any]], object]], Path]:
    """A copy of the folder whose document was changed."""

    def changed(edit: Callable[[dict[str, Any]], object]) -> Path:
        folder = tmp_path / "boards"
        shutil.copytree(boards, folder)
        document = yaml.safe_load((folder / "chessboard.yaml").read_text())
        edit(document)
        (folder / "chessboard.yaml").write_text(yaml.safe_dump(document))
        return folder

    return changed


def test_maps_are_those_of_the_true_cameras(boards: Path, tmp_path: Path) -> None:
    out = tmp_path / "calibration.json"
    done = run_footscan("calibrate", "chessboard", boards, "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    calibration = read_calibration(out)
    assert calibration.format == "footscan.calibration/4"
    assert [camera.plane for camera in calibration.cameras] == [None, None]
    y, z = (axis.ravel() for axis in np.meshgrid(np.arange(-60, 61, 5.0), np.arange(0, 111, 5.0)))
    for camera_id in CAMERAS:
        camera = calibration.camera(camera_id)
        pixels = standard_scanner(1).camera(camera_id).project_plane(y, z)
        inside = is_supported(camera, pixels)
        assert np.count_nonzero(inside) > 200
        errors = np.linalg.norm(to_world(camera, pixels[inside]) - np.column_stack([y, z])[inside], axis=1)
        assert np.sqrt(np.mean(errors**2)) < 0.06
        assert errors.max() < 0.15
        assert camera.held_out_rms_mm is not None
        assert camera.held_out_rms_mm < 0.06
    shown = json.loads(done.stdout)
    true = [standard_scanner(1).camera(camera_id).lens.focal_px for camera_id in CAMERAS]
    found = [camera["pinhole"]["focal_px"][0] for camera in shown["cameras"]]
    np.testing.assert_allclose(found, true, rtol=0.005)


def test_without_the_glass_a_camera_below_is_reported(change: Callable[..., Path]) -> None:
    folder = change(lambda document: document.pop("glass"))
    done = run_footscan("calibrate", "chessboard", folder)
    assert done.returncode == 0, done.stderr
    assert "camera 6: held-out error 0." in done.stderr
    assert "camera 1: held-out" not in done.stderr


def test_a_turned_plane_is_found_and_written(films: MadeOnce, tmp_path: Path) -> None:
    out = tmp_path / "calibration.json"
    done = run_footscan("calibrate", "chessboard", films("boards-turned", film_turned), "--out", out)
    assert done.returncode == 0, done.stderr
    plane = read_calibration(out).camera(1).plane
    assert plane is not None
    assert plane.yaw == pytest.approx(-np.tan(np.radians(TURN_DEG)), abs=0.003)
    assert plane.pitch == pytest.approx(0.0, abs=0.003)
    assert plane.head == 1


def test_stripe_and_board_may_be_one_picture(change: Callable[..., Path]) -> None:
    def one_picture(document: dict[str, Any]) -> None:
        document["cameras"] = document["cameras"][:1]
        for picture in document["cameras"][0]["pictures"]:
            if "laser" in picture:
                picture["board"] = picture["laser"]
                picture.pop("off", None)

    done = run_footscan("calibrate", "chessboard", change(one_picture), "--json")
    assert done.returncode == 0, done.stderr
    [camera] = json.loads(done.stdout)["cameras"]
    assert camera["held_out_rms_mm"] < 0.1


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda d: d.update(squares=[9, 7]), "squares: expected an even and an odd number"),
        (lambda d: d.update(square_mm=0.2), "square_mm: "),
        (lambda d: d.update(squares=[12, 9]), "camera 1: 0 pictures of the whole board, expected at least 3"),
        (lambda d: d["places"]["front"].update(along=[0, 2, 0]), "places.front.along: has length 2"),
        (lambda d: d["places"]["front"].update(down=[0, 1, 0]), "expected directions at right angles"),
        (lambda d: d["cameras"][0]["pictures"][-1].update(place="table"), "camera 1: place: expected one of"),
        (lambda d: d["cameras"][0]["pictures"][-1].pop("place"), "expected at least one picture with a place"),
        (lambda d: d["cameras"][0]["pictures"][0].update(board="gone.jpg"), "gone.jpg: "),
        (lambda d: d["cameras"][0]["pictures"][0].update(board="chessboard.yaml"), "expected a JPEG or PNG image"),
        (lambda d: d["cameras"][0]["pictures"][0].update(board="../x.jpg"), "camera 1: pictures.0.board: "),
        (lambda d: d["cameras"].append(copy.deepcopy(d["cameras"][0])), "camera 1 is listed twice"),
        (lambda d: d["cameras"][0]["pictures"][0].pop("laser"), "off: expected a picture with the laser"),
        (lambda d: d["places"]["front"].update(along=[1, 0, 0]), "laser plane would be turned by"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line(
    change: Callable[..., Path], edit: Callable[[dict[str, Any]], object], message: str
) -> None:
    done = run_footscan("calibrate", "chessboard", change(edit))
    assert done.returncode == 2, done.stderr
    [line] = done.stderr.strip().splitlines()
    assert line.startswith("footscan: ")
    assert message in line

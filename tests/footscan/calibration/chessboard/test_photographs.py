"""Corners, pinhole and stripe on real photographs of a chessboard."""

import os
from pathlib import Path

import numpy as np
import pytest

from footscan.calibration.chessboard.board_stripe import board_points, find_stripe, on_board
from footscan.calibration.chessboard.corners import Board, find_corners, spacing_px
from footscan.calibration.chessboard.pane import Sight
from footscan.calibration.chessboard.pinhole import fit_pinhole, pose_of
from footscan.calibration.chessboard.views import BoardShot, usable_views
from footscan.frames.image import decode_image

BOARD = Board((12, 7), 13.0)
IMAGE_PX = (960, 1280)


@pytest.fixture(scope="module")
def ciclop() -> Path:
    if not os.environ.get("FOOTSCAN_DATA"):
        pytest.skip("set FOOTSCAN_DATA to the folder that holds ciclop/")
    return Path(os.environ["FOOTSCAN_DATA"]) / "ciclop"


def test_photographs_of_a_board_fit_one_camera(ciclop: Path) -> None:
    files = sorted((ciclop / "camera_calib").glob("*.jpg"))
    pictures = [(file.name, decode_image(file.read_bytes())) for file in files]
    shots = [BoardShot(name, picture, None, None, None) for name, picture in pictures]
    views, remarks = usable_views(shots, BOARD, IMAGE_PX)
    assert len(views) == 16, remarks
    fitted = fit_pinhole([(view.points, view.pixels) for view in views], IMAGE_PX)
    assert np.sqrt(np.mean(fitted.errors_px**2)) < 0.3
    assert fitted.focal_sd < 0.003
    halves = [fit_pinhole([(v.points, v.pixels) for v in part], IMAGE_PX) for part in (views[::2], views[1::2])]
    np.testing.assert_allclose(*(half.pinhole.focal_px for half in halves), rtol=0.01)
    np.testing.assert_allclose(fitted.pinhole.focal_px[0], fitted.pinhole.focal_px[1], rtol=0.005)

    board = decode_image((ciclop / "pattern" / "pattern.png").read_bytes())
    corners = find_corners(board, BOARD)
    assert corners is not None
    pose = pose_of(BOARD.points, corners, fitted.pinhole)
    stripe = find_stripe(decode_image((ciclop / "pattern" / "laser-0-255-255-8.png").read_bytes()), None)
    sight = Sight(fitted.pinhole)
    found = on_board(stripe, BOARD, sight, pose, spacing_px(corners, BOARD))
    assert found is not None
    places = pose.undo(board_points(found.pixels, sight, pose))[:, :2]
    assert np.ptp(places, axis=0).max() > 4 * BOARD.square_mm
    across = np.linalg.svd(places - places.mean(axis=0), full_matrices=False)[0][:, 1]
    scatter = across * np.linalg.svd(places - places.mean(axis=0), compute_uv=False)[1]
    print(f"corners {np.sqrt(np.mean(fitted.errors_px**2)):.3f} px, {len(places)} points, {scatter.std():.3f} mm")
    assert scatter.std() < 0.1

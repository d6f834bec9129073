"""Pinhole, pane, laser plane and the calibration of a camera, from projected boards whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from footscan.calibration.chessboard.board_stripe import BoardStripe, on_board
from footscan.calibration.chessboard.camera_fit import BoardView, CameraFit, Glass, fit_camera
from footscan.calibration.chessboard.corners import Board, in_order
from footscan.calibration.chessboard.from_pictures import calibrate_camera
from footscan.calibration.chessboard.pane import Pane, Sight
from footscan.calibration.chessboard.pinhole import Pinhole, Pose, UndeterminedPinholeError, fit_pinhole, pose_of
from footscan.calibration.chessboard.planes import head_planes, laser_planes
from footscan.calibration.chessboard.sheet import Plane, UndeterminedPlaneError, across_travel, fit_plane
from footscan.calibration.models.maps import prediction_covariance, to_world
from footscan.stripe.points import STRIPE_DTYPE
from schemas.base.errors import RefusedInput

Floats = NDArray[np.float64]

BOARD = Board((10, 7), 9.0)
CAMERA = Pinhole((1000.0, 1004.0), (322.0, 236.0), (-0.1, 0.05, 0.001, -0.002))
IMAGE_PX = (640, 480)
UPPER = Pose(Rotation.from_euler("xyz", [100, 40, 10], degrees=True).as_matrix(), np.array([5.0, 4.0, 270.0]))
LOWER = Pose(np.array([[0.0, 1.0, 0.0], [-0.8, 0.0, 0.6], [0.6, 0.0, 0.8]]), np.array([0.0, 0.0, 250.0]))
"""From the scanner's frame to that of a camera."""


def held(count: int, seed: int = 1) -> list[Pose]:
    """Poses of the board before the camera, tilted to different sides."""
    random = np.random.default_rng(seed)
    half = 9.0 * np.array([4.0, 2.5, 0.0])
    poses = []
    for _ in range(count):
        turn = Rotation.from_rotvec([*random.uniform(-0.6, 0.6, 2), random.uniform(-3, 3)]).as_matrix()
        middle = np.array([*random.uniform(-25, 25, 2), random.uniform(230, 310)])
        poses.append(Pose(turn, middle - turn @ half))
    return poses


def views_of(scanner: Pose, plane: Plane, sight: Sight, noise_px: float = 0.0, count: int = 12) -> list[BoardView]:
    """Views of boards with a stripe where they cut a plane of the scanner's frame; the first board is placed."""
    random = np.random.default_rng(7)
    seen = plane_in_camera(plane, scanner)
    views = []
    for number, pose in enumerate(held(count)):
        along = np.cross(pose.rotation[:, 2], seen.normal)
        along /= np.linalg.norm(along)
        both = np.stack([pose.rotation[:, 2], seen.normal, along])
        middle = pose.apply(np.array([[36.0, 22.5, 0.0]]))[0]
        start = np.linalg.solve(both, [pose.rotation[:, 2] @ pose.translation, seen.distance, along @ middle])
        line = start + np.linspace(-20.0, 20.0, 40)[:, np.newaxis] * along
        pixels = [sight.pinhole.pixels(sight.apparent(points)) for points in (pose.apply(BOARD.points), line)]
        noisy = [part + random.normal(0.0, noise_px, part.shape) for part in pixels]
        turn = scanner.rotation.T @ pose.rotation
        place = Pose(turn, scanner.undo(pose.translation[np.newaxis])[0])
        stripe = BoardStripe(noisy[1], np.arange(40) // 8)
        views.append(BoardView(f"{number}", BOARD.points, noisy[0], 25.0, stripe, place if number == 0 else None))
    return views


def plane_in_camera(plane: Plane, scanner: Pose) -> Plane:
    normal = scanner.rotation @ plane.normal
    return Plane(normal, plane.distance + float(normal @ scanner.translation))


ACROSS = Plane(np.array([1.0, 0.0, 0.0]), 0.0)
TURNED = Plane(np.array([1.0, -0.02, 0.03]) / np.linalg.norm([1.0, -0.02, 0.03]), 0.4)


def test_corners_get_the_order_of_the_board_from_any_start() -> None:
    grid = np.stack(np.meshgrid(np.arange(40.0, 40 + 20 * 9, 20), np.arange(50.0, 50 + 20 * 6, 20)), axis=-1)
    row, column = np.indices((7, 10))
    squares = np.where((row + column) % 2 == 0, 20, 220).astype(np.uint8)
    grey = np.full((240, 320), 255, np.uint8)
    grey[30:170, 20:220] = np.kron(squares, np.ones((20, 20), np.uint8))
    for start in (grid, grid[::-1, ::-1], grid[::-1], grid[:, ::-1]):
        found = in_order(start.reshape(-1, 2), grey, BOARD)
        assert found is not None
        np.testing.assert_array_equal(found, grid.reshape(-1, 2))
    assert in_order(grid.reshape(-1, 2), np.full_like(grey, 9), BOARD) is None


def test_pinhole_is_that_of_exact_corners() -> None:
    views = [(BOARD.points, CAMERA.pixels(pose.apply(BOARD.points))) for pose in held(8)]
    found = fit_pinhole(views, IMAGE_PX)
    np.testing.assert_allclose(found.pinhole.focal_px, CAMERA.focal_px, atol=0.01)
    np.testing.assert_allclose(found.pinhole.centre_px, CAMERA.centre_px, atol=0.01)
    np.testing.assert_allclose(found.pinhole.distortion, CAMERA.distortion, atol=1e-3)
    assert found.errors_px.max() < 1e-3
    pose = pose_of(*views[3], CAMERA)
    np.testing.assert_allclose(pose.translation, held(8)[3].translation, atol=1e-4)


def test_two_views_are_too_few() -> None:
    views = [(BOARD.points, CAMERA.pixels(pose.apply(BOARD.points))) for pose in held(2)]
    with pytest.raises(UndeterminedPinholeError, match="2 pictures of the whole board, expected at least 3"):
        fit_pinhole(views, IMAGE_PX)


def test_a_ray_through_a_pane_meets_what_is_seen_through_it() -> None:
    pane = Pane(6.0, 1.52, np.array([0.0, 0.6, 0.8]))
    sight = Sight(CAMERA, pane)
    points = np.array([[10.0, 5.0, 200.0], [-40.0, 30.0, 300.0]])
    origins, directions = sight.rays(CAMERA.pixels(sight.apparent(points)))
    np.testing.assert_allclose(origins + directions * (points - origins)[:, 2:], points, atol=1e-9)


def test_a_pane_displaces_as_by_the_law_of_snell() -> None:
    pane = Pane(6.0, 1.5, np.array([0.0, 0.0, 1.0]))
    inside = np.arcsin(np.sin(np.radians(40.0)) / 1.5)
    missing = 6.0 * (np.tan(np.radians(40.0)) - np.tan(inside)) / np.tan(np.radians(40.0))
    shift = pane.shift(np.array([[np.tan(np.radians(40.0)), 0.0, 1.0]]))
    np.testing.assert_allclose(shift, [[0.0, 0.0, missing]], atol=1e-12)


def test_plane_ignores_a_stripe_that_is_none() -> None:
    y = np.linspace(-20, 20, 30)
    stripes = [np.column_stack([0.1 * y + 2.0, y, np.full(30, z)]) for z in (0.0, 10.0, 20.0, 30.0)]
    stripes.append(np.column_stack([0.1 * y + 9.0, y, np.full(30, 15.0)]))
    plane, means = fit_plane(stripes)
    np.testing.assert_allclose(across_travel(plane, 57.0), [2.0, 0.1, 0.0], atol=1e-6)
    np.testing.assert_allclose(np.abs(means), [0.0, 0.0, 0.0, 0.0, 7.0 / np.hypot(1.0, 0.1)], atol=1e-6)


def test_stripes_on_one_line_are_no_plane() -> None:
    y = np.linspace(-20, 20, 30)
    with pytest.raises(UndeterminedPlaneError, match="nearly on one line"):
        fit_plane([np.column_stack([y, y, np.full(30, z)]) for z in (0.0, 1.0, 2.0)])
    with pytest.raises(UndeterminedPlaneError, match="found on 1 boards, expected at least 2"):
        fit_plane([np.column_stack([y, y, y])])
    with pytest.raises(UndeterminedPlaneError, match="turned by 90 degrees"):
        across_travel(Plane(np.array([0.0, 1.0, 0.0]), 0.0), 57.0)


def test_stripe_of_a_board_is_one_line_on_white() -> None:
    pose = held(1)[0]
    x = np.linspace(-8.0, 75.0, 600)
    line, other = (np.column_stack([x, a + b * x, 0 * x]) for a, b in ((20.0, 0.1), (33.0, -0.1)))
    places = np.concatenate([line, other[::3]])
    points = np.zeros(len(places), STRIPE_DTYPE)
    points["i"], points["j"] = CAMERA.pixels(pose.apply(places)).T
    points["width"] = 5.0
    found = on_board(points, BOARD, Sight(CAMERA), pose, 30.0)
    assert found is not None
    taken = {tuple(pixel) for pixel in found.pixels}
    numbers = [n for n, pixel in enumerate(zip(points["i"], points["j"], strict=True)) if tuple(pixel) in taken]
    assert max(numbers) < 600
    column, row = np.floor(places[numbers, :2] / 9.0).T + 1
    assert np.all((column + row) % 2 == 1)
    within = places[numbers, :2] % 9.0
    assert np.minimum(within, 9.0 - within).min() > 2.5 * 9.0 / 30.0 - 1e-6
    assert on_board(points[:5], BOARD, Sight(CAMERA), pose, 30.0) is None


@pytest.mark.parametrize("plane", [ACROSS, TURNED], ids=["across", "turned"])
def test_exact_pictures_give_the_exact_map(plane: Plane) -> None:
    views = views_of(UPPER, plane, Sight(CAMERA))
    made = calibrate_camera(1, views, IMAGE_PX, None, "boards")
    truth = CameraFit(Sight(CAMERA), plane_in_camera(plane, UPPER), UPPER, [], np.empty(0), 0.0, 0.0)
    pixels = np.array([[320.0, 240.0], [200.0, 150.0], [450.0, 300.0]])
    np.testing.assert_allclose(to_world(made.camera, pixels), truth.world(pixels), atol=2e-3)
    np.testing.assert_allclose(made.sheet.values, across_travel(plane, 57.0), atol=1e-3)
    assert made.camera.held_out_rms_mm is not None
    assert made.camera.held_out_rms_mm < 2e-3


def test_covariance_predicts_the_error_of_noisy_pictures() -> None:
    truth = CameraFit(Sight(CAMERA), plane_in_camera(ACROSS, UPPER), UPPER, [], np.empty(0), 0.0, 0.0)
    views = views_of(UPPER, ACROSS, Sight(CAMERA), noise_px=0.1)
    made = calibrate_camera(1, views, IMAGE_PX, None, "boards")
    pixels = np.column_stack([axis.ravel() for axis in np.meshgrid(np.linspace(220, 420, 5), np.linspace(160, 320, 5))])
    errors = to_world(made.camera, pixels) - truth.world(pixels)
    predicted = prediction_covariance(made.camera, pixels)
    assert predicted is not None
    sigma = np.sqrt(np.trace(predicted, axis1=1, axis2=2).mean())
    rms = np.sqrt((errors**2).sum(axis=1).mean())
    assert 0.2 < rms / sigma < 5.0
    assert rms < 0.1


def test_a_camera_below_looks_through_the_glass() -> None:
    pane = Pane(6.0, 1.52, LOWER.rotation[:, 2])
    views = views_of(LOWER, ACROSS, Sight(CAMERA, pane), count=14)
    with_glass = fit_camera(views, IMAGE_PX, Glass(6.0, 1.52))
    without = fit_camera(views, IMAGE_PX)
    np.testing.assert_allclose(with_glass.sight.pinhole.focal_px, CAMERA.focal_px, atol=0.05)
    assert abs(without.sight.pinhole.focal_px[0] - CAMERA.focal_px[0]) > 1.0
    truth = replace(with_glass, sight=Sight(CAMERA, pane), plane=plane_in_camera(ACROSS, LOWER), scanner=LOWER)
    pixels = np.array([[320.0, 240.0], [250.0, 200.0]])
    np.testing.assert_allclose(with_glass.world(pixels), truth.world(pixels), atol=5e-3)


def test_boards_that_are_all_parallel_are_refused() -> None:
    views = views_of(UPPER, ACROSS, Sight(CAMERA))
    flat = [replace(view, stripe=None) for view in views]
    with pytest.raises(RefusedInput, match=r"boards: camera 4: the stripe was found on 0 boards"):
        calibrate_camera(4, flat, IMAGE_PX, None, "boards")
    unplaced = [replace(view, place=None) for view in views]
    with pytest.raises(RefusedInput, match=r"boards: camera 4: the board was found in no picture with a place"):
        calibrate_camera(4, unplaced, IMAGE_PX, None, "boards")


@pytest.mark.parametrize(("plane", "written"), [(ACROSS, False), (TURNED, True)], ids=["across", "turned"])
def test_a_plane_is_written_if_it_is_turned(plane: Plane, written: bool) -> None:
    made = calibrate_camera(1, views_of(UPPER, plane, Sight(CAMERA)), IMAGE_PX, None, "boards")
    planes = head_planes([made], {1: 1}, 0.05, BOARD.diagonal_mm)
    written_planes = laser_planes(planes, {1: 1})
    assert bool(written_planes) == written
    if written:
        assert written_planes[1].yaw == pytest.approx(0.02, abs=1e-3)
        assert written_planes[1].pitch == pytest.approx(-0.03, abs=1e-3)
        assert written_planes[1].offset_mm == 0.0

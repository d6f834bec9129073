"""A camera and its laser plane in the scanner's frame, from views of a board."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chessboard.board_stripe import BoardStripe, board_points
from footscan.calibration.chessboard.pinhole import (
    Pinhole,
    PinholeFit,
    Pose,
    UndeterminedPinholeError,
    fit_pinhole,
    pose_of,
    refined_pose,
)
from footscan.calibration.chessboard.sheet import Plane, fit_plane

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class BoardView:
    """A picture of the board, as far as it is used."""

    name: str
    points: Floats
    """(N, 3) mm, board frame, of the corners that are used."""
    pixels: Floats
    """(N, 2) px, of the same corners."""
    spacing_px: float
    """Least distance of neighbouring corners."""
    stripe: BoardStripe | None
    place: Pose | None
    """From the board's frame to the scanner's, if the board stood at a known place."""


@dataclass(frozen=True)
class CameraFit:
    """A calibrated camera."""

    pinhole: Pinhole
    plane: Plane
    """Of the laser, camera frame."""
    scanner: Pose
    """From the scanner's frame to the camera's."""
    poses: list[Pose]
    """Of the board in each view."""
    stripe_mm: Floats
    """(S,) mean distance of each view's stripe from the plane."""
    focal_sd: float
    """Relative standard deviation of the focal length."""
    corners_px: float
    """Distance of the corners from where they are projected to, root mean square."""

    def world(self, pixels: Floats) -> Floats:
        """Y and Z (N, 2), mm, scanner frame, at which `pixels` (N, 2) see the laser plane; NaN where they do not."""
        return self.scanner.undo(self.plane.meet(self.pinhole.directions(pixels)))[:, 1:]

    def board_world(self, pixels: Floats, pose: Pose) -> Floats:
        """Y and Z (N, 2), mm, scanner frame, at which `pixels` (N, 2) see a board in its pose."""
        return self.scanner.undo(board_points(pixels, self.pinhole, pose))[:, 1:]


def fit_camera(views: Sequence[BoardView], image_px: tuple[int, int]) -> CameraFit:
    """Calibrate a camera from views of the board, at least one of them at a known place.

    The pinhole is that of all views, the plane that of their stripes, and the pose that of the placed boards together.

    Raises
    ------
    UndeterminedPinholeError, UndeterminedPlaneError
        The views do not determine the camera, or the laser plane.
    """
    fitted = fit_pinhole([(view.points, view.pixels) for view in views], image_px)
    stripes = [
        board_points(view.stripe.pixels, fitted.pinhole, pose)
        for view, pose in zip(views, fitted.poses, strict=True)
        if view.stripe is not None
    ]
    plane, stripe_mm = fit_plane(stripes)
    scanner = _scanner_pose(views, fitted)
    corners_px = float(np.sqrt(np.mean(fitted.errors_px**2)))
    return CameraFit(fitted.pinhole, plane, scanner, fitted.poses, stripe_mm, fitted.focal_sd, corners_px)


def _scanner_pose(views: Sequence[BoardView], fitted: PinholeFit) -> Pose:
    """The pose of the scanner's frame by all placed boards, from that of the first one."""
    placed = [(view, view.place, pose) for view, pose in zip(views, fitted.poses, strict=True) if view.place]
    if not placed:
        raise UndeterminedPinholeError("the board was found in no picture with a place")
    _, place, pose = placed[0]
    assert place is not None
    turn = pose.rotation @ place.rotation.T
    start = Pose(turn, pose.translation - turn @ place.translation)
    points = np.concatenate([place.apply(view.points) for view, place, _ in placed if place])
    pixels = np.concatenate([view.pixels for view, _, _ in placed])
    return refined_pose(points, pixels, fitted.pinhole, start)


def pose_of_view(view: BoardView, pinhole: Pinhole) -> Pose:
    """The pose of the board in a view that the pinhole was not fitted to."""
    return pose_of(view.points, view.pixels, pinhole)

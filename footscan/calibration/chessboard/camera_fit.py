"""A camera and its laser plane in the scanner's frame, from views of a board."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chessboard.board_stripe import BoardStripe, board_points
from footscan.calibration.chessboard.pane import Pane, Sight
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

PANE_ROUNDS = 30
"""How often what is seen through a pane is displaced and the camera fitted again, at most: a bound of time."""
CONVERGED_PX = 1e-3
"""Change of focal length and principal point at which that ends; the map then changes by less than 1e-3 mm."""


@dataclass(frozen=True)
class Glass:
    """The glass plate on which feet stand, Z = 0 being its upper face; cameras below look through it."""

    thickness_mm: float
    index: float


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

    sight: Sight
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
        return self.scanner.undo(self.plane.meet(*self.sight.rays(pixels)))[:, 1:]

    def board_world(self, pixels: Floats, pose: Pose) -> Floats:
        """Y and Z (N, 2), mm, scanner frame, at which `pixels` (N, 2) see a board in its pose."""
        return self.scanner.undo(board_points(pixels, self.sight, pose))[:, 1:]

    def pose_of(self, view: BoardView) -> Pose:
        """The pose of the board in a view to which the camera was not fitted."""
        pose = pose_of(view.points, view.pixels, self.sight.pinhole)
        for _ in range(PANE_ROUNDS if self.sight.pane else 0):
            earlier, seen = pose, _displaced(view.points, pose, self.sight)
            pose = refined_pose(seen, view.pixels, self.sight.pinhole, pose)
            if np.abs(pose.translation - earlier.translation).max() < CONVERGED_PX:
                break
        return pose


def fit_camera(views: Sequence[BoardView], image_px: tuple[int, int], glass: Glass | None = None) -> CameraFit:
    """Calibrate a camera from views of the board, at least one of them at a known place.

    The pinhole is that of all views, the plane that of their stripes, and the pose that of the placed boards together.
    For a camera that turns out to stand below the glass, boards are displaced to where they are seen through it, which
    depends on the camera's pose, until camera and pose do not change any more.

    Raises
    ------
    UndeterminedPinholeError, UndeterminedPlaneError
        The views do not determine the camera, or the laser plane.
    """
    fitted = fit_pinhole([(view.points, view.pixels) for view in views], image_px)
    sight = Sight(fitted.pinhole)
    scanner = _scanner_pose(views, fitted, sight)
    if glass is not None and scanner.undo(np.zeros((1, 3)))[0, 2] < -glass.thickness_mm:
        fitted, sight, scanner = _behind(glass, views, image_px, fitted, scanner)
    stripes = [
        board_points(view.stripe.pixels, sight, pose)
        for view, pose in zip(views, fitted.poses, strict=True)
        if view.stripe is not None
    ]
    plane, stripe_mm = fit_plane(stripes)
    corners_px = float(np.sqrt(np.mean(fitted.errors_px**2)))
    return CameraFit(sight, plane, scanner, fitted.poses, stripe_mm, fitted.focal_sd, corners_px)


def _behind(
    glass: Glass, views: Sequence[BoardView], image_px: tuple[int, int], fitted: PinholeFit, scanner: Pose
) -> tuple[PinholeFit, Sight, Pose]:
    """Fit pinhole and pose to what is seen through the glass, from a fit without it."""
    sight = Sight(fitted.pinhole)
    for _ in range(PANE_ROUNDS):
        sight = Sight(fitted.pinhole, Pane(glass.thickness_mm, glass.index, scanner.rotation[:, 2]))
        seen = [
            (_displaced(view.points, pose, sight), view.pixels) for view, pose in zip(views, fitted.poses, strict=True)
        ]
        earlier, fitted = fitted.pinhole, fit_pinhole(seen, image_px, fitted.pinhole)
        sight = replace(sight, pinhole=fitted.pinhole)
        scanner = _scanner_pose(views, fitted, sight)
        if _change_px(earlier, fitted.pinhole) < CONVERGED_PX:
            return fitted, sight, scanner
    raise UndeterminedPinholeError("the camera seen through the glass does not settle, expected more tilted boards")


def _displaced(points: Floats, pose: Pose, sight: Sight) -> Floats:
    """Where `points` (N, 3), mm, are seen, in their own frame, of which `pose` leads to the camera's."""
    return pose.undo(sight.apparent(pose.apply(points)))


def _change_px(one: Pinhole, other: Pinhole) -> float:
    """The largest difference of the numbers in px."""
    return max(
        abs(a - b) for a, b in zip((*one.focal_px, *one.centre_px), (*other.focal_px, *other.centre_px), strict=True)
    )


def _scanner_pose(views: Sequence[BoardView], fitted: PinholeFit, sight: Sight) -> Pose:
    """The pose of the scanner's frame by all placed boards, from that of the first one."""
    placed = [(view, view.place, pose) for view, pose in zip(views, fitted.poses, strict=True) if view.place]
    if not placed:
        raise UndeterminedPinholeError("the board was found in no picture with a place")
    _, place, pose = placed[0]
    assert place is not None
    turn = pose.rotation @ place.rotation.T
    scanner = Pose(turn, pose.translation - turn @ place.translation)
    points = np.concatenate([place.apply(view.points) for view, place, _ in placed if place])
    pixels = np.concatenate([view.pixels for view, _, _ in placed])
    return refined_pose(_displaced(points, scanner, sight), pixels, fitted.pinhole, scanner)

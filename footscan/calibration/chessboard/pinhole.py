"""A pinhole camera with lens distortion, from views of a plane: Zhang's method.

Z. Zhang, "A flexible new technique for camera calibration", IEEE Transactions on Pattern Analysis and Machine
Intelligence 22(11), 2000, 1330-1334, doi:10.1109/34.888718; in the implementation of OpenCV. Distortion is that of
D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37, 1971, 855-866, with k1, k2, p1 and p2.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FEWEST_VIEWS = 3
"""Views of a plane that determine the five numbers of a pinhole (Zhang 2000, section 3.1)."""
UNDISTORT_STEPS = 30
"""Fixed-point steps at most that remove the distortion: a bound of time."""
UNDISTORTED = 1e-12
"""Largest last step, in focal lengths."""


class UndeterminedPinholeError(Exception):
    """The views do not determine the camera."""


@dataclass(frozen=True)
class Pose:
    """A rigid transform from a board's or the scanner's frame to the camera's: x to the right, y down, z ahead, mm."""

    rotation: Floats
    """(3, 3)."""
    translation: Floats
    """(3,) mm."""

    def apply(self, points: Floats) -> Floats:
        """`points` (N, 3), mm, in the camera's frame."""
        return np.asarray(points @ self.rotation.T + self.translation)

    def undo(self, points: Floats) -> Floats:
        """`points` (N, 3), mm, of the camera's frame in the other one."""
        return np.asarray((points - self.translation) @ self.rotation)


@dataclass(frozen=True)
class Pinhole:
    """A camera: distorted places in focal lengths, times `focal_px`, plus `centre_px`, are pixels."""

    focal_px: tuple[float, float]
    """Along i and along j."""
    centre_px: tuple[float, float]
    """Principal point (i, j)."""
    distortion: tuple[float, float, float, float]
    """k1, k2, p1, p2, from the ideal to the seen place in focal lengths."""

    @property
    def matrix(self) -> Floats:
        """(3, 3) from directions to pixels, without distortion."""
        (fi, fj), (ci, cj) = self.focal_px, self.centre_px
        return np.array([[fi, 0.0, ci], [0.0, fj, cj], [0.0, 0.0, 1.0]])

    def pixels(self, points: Floats) -> Floats:
        """Project `points` (N, 3), mm, camera frame, to pixels (N, 2)."""
        return np.asarray(self._distorted(points[:, :2] / points[:, 2:]) * self.focal_px + np.asarray(self.centre_px))

    def directions(self, pixels: Floats) -> Floats:
        """Directions (N, 3), camera frame, in which the camera sees at `pixels` (N, 2); their z is 1.

        >>> camera = Pinhole((900.0, 910.0), (320.0, 240.0), (-0.1, 0.03, 0.001, -0.001))
        >>> seen = np.array([[30.0, -20.0, 250.0]])
        >>> print((250.0 * camera.directions(camera.pixels(seen))).round(9))
        [[ 30. -20. 250.]]
        """
        target = (pixels - np.asarray(self.centre_px)) / self.focal_px
        ideal = target.copy()
        for _ in range(UNDISTORT_STEPS):
            step = target - self._distorted(ideal)
            ideal = ideal + step
            if np.abs(step).max(initial=0.0) < UNDISTORTED:
                break
        return np.column_stack([ideal, np.ones(len(ideal))])

    def _distorted(self, ideal: Floats) -> Floats:
        k1, k2, p1, p2 = self.distortion
        x, y = ideal.T
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * k2)
        return np.column_stack(
            [
                x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            ]
        )


@dataclass(frozen=True)
class PinholeFit:
    """A pinhole and the poses of the boards from which it was fitted."""

    pinhole: Pinhole
    poses: list[Pose]
    focal_sd: float
    """Relative standard deviation of the focal length."""
    errors_px: Floats
    """(V,) distance of each view's corners from where they are projected to, root mean square."""


def fit_pinhole(
    views: Sequence[tuple[Floats, Floats]], image_px: tuple[int, int], start: Pinhole | None = None
) -> PinholeFit:
    """Fit a pinhole to the corners of a board in several poses.

    Parameters
    ----------
    views : corners of the board (N, 3), mm, board frame, and their pixels (N, 2); one pair a picture.
    image_px : columns and rows of the pictures.
    start : from which the fit starts; needed if the corners of a board do not lie in one plane.

    Raises
    ------
    UndeterminedPinholeError
        There are fewer than three views, or they are all parallel, or too much alike.
    """
    import cv2

    if len(views) < FEWEST_VIEWS:
        raise UndeterminedPinholeError(f"{len(views)} pictures of the whole board, expected at least {FEWEST_VIEWS}")
    try:
        _, matrix, distortion, turns, shifts, spreads, _, errors = cv2.calibrateCameraExtended(
            [points.astype(np.float32) for points, _ in views],
            [pixels.astype(np.float32).reshape(-1, 1, 2) for _, pixels in views],
            image_px,
            None if start is None else start.matrix,
            None if start is None else np.array(start.distortion),
            flags=cv2.CALIB_FIX_K3 | (0 if start is None else cv2.CALIB_USE_INTRINSIC_GUESS),
        )  # fmt: skip
    except cv2.error:
        raise UndeterminedPinholeError("the poses of the board do not determine the camera") from None
    k1, k2, p1, p2 = (float(value) for value in np.ravel(distortion)[:4])
    pinhole = Pinhole(
        (float(matrix[0, 0]), float(matrix[1, 1])), (float(matrix[0, 2]), float(matrix[1, 2])), (k1, k2, p1, p2)
    )
    poses = [Pose(_rotation(turn), np.ravel(shift)) for turn, shift in zip(turns, shifts, strict=True)]
    focal_sd = float(np.ravel(spreads)[:2].max() / max(pinhole.focal_px))
    if not np.isfinite([*np.ravel(matrix), k1, k2, p1, p2, focal_sd]).all():
        raise UndeterminedPinholeError("the poses of the board do not determine the camera")
    return PinholeFit(pinhole, poses, focal_sd, np.ravel(errors))


def pose_of(points: Floats, pixels: Floats, pinhole: Pinhole) -> Pose:
    """The pose in which the camera sees `points` (N, 3), mm, of a plane at `pixels` (N, 2).

    It has the least squares of the distances in the picture.

    Raises
    ------
    UndeterminedPinholeError
        The pixels are no picture of the points.
    """
    import cv2

    try:
        solved, turn, shift = cv2.solvePnP(
            points, pixels, pinhole.matrix, np.array(pinhole.distortion), flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error:
        solved = False
    if not solved:
        raise UndeterminedPinholeError("the corners determine no pose of the board")
    return refined_pose(points, pixels, pinhole, Pose(_rotation(turn), np.ravel(shift)))


def refined_pose(points: Floats, pixels: Floats, pinhole: Pinhole, start: Pose) -> Pose:
    """The pose in which the camera sees `points` (N, 3), mm, at `pixels` (N, 2), by least squares in the picture."""
    import cv2
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(start.rotation).as_rotvec().reshape(3, 1)
    turn, shift = cv2.solvePnPRefineLM(
        points, pixels, pinhole.matrix, np.array(pinhole.distortion), turn, start.translation.reshape(3, 1).copy()
    )
    return Pose(_rotation(turn), np.ravel(shift))


def _rotation(turn: Floats) -> Floats:
    """(3, 3) of a rotation vector."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(np.ravel(turn)).as_matrix())

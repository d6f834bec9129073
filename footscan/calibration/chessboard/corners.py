"""The inner corners of a chessboard in a picture.

They are found by OpenCV, by the detector of A. Duda and U. Frese, "Accurate detection and localization of checkerboard
corners for calibration", BMVC 2018.
"""

from dataclasses import dataclass
from math import hypot

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rgb = NDArray[np.uint8]

WINDOW = 0.4
"""Half the side of the window in which a corner is refined, in distances of the corners; tuned on pictures of the
virtual scanner, where 0.3 and less is worse. From 0.5 on a window contains the neighbours."""
SMALLEST_WINDOW_PX = 3
"""Chosen by hand."""
REFINE_STEPS, REFINED_PX = 100, 1e-4
"""Steps at most, a bound of time; and the last step, px."""


@dataclass(frozen=True)
class Board:
    """A chessboard. In its own frame x runs along from the first inner corner, y down, and z away from the viewer."""

    squares: tuple[int, int]
    """Along and down; one number is even and the other odd. Both corner squares on the left are black."""
    square_mm: float

    @property
    def shape(self) -> tuple[int, int]:
        """Inner corners along and down."""
        return self.squares[0] - 1, self.squares[1] - 1

    @property
    def points(self) -> Floats:
        """(N, 3) mm, board frame: the inner corners, row by row, the first at the origin.

        >>> print(Board((4, 3), 10.0).points[:, :2].tolist())
        [[0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [0.0, 10.0], [10.0, 10.0], [20.0, 10.0]]
        """
        along, down = self.shape
        y, x = np.mgrid[0:down, 0:along]
        return self.square_mm * np.column_stack([x.ravel(), y.ravel(), np.zeros(along * down)])

    @property
    def diagonal_mm(self) -> float:
        """Distance of the first inner corner from the last."""
        along, down = self.shape
        return self.square_mm * hypot(along - 1, down - 1)

    def is_white(self, column: NDArray[np.intp], row: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether the squares in a column (N,) and a row (N,), from 0 at the upper left corner, are white; (N,)."""
        inside = (column >= 0) & (column < self.squares[0]) & (row >= 0) & (row < self.squares[1])
        return np.asarray(inside & ((column + row) % 2 == 1))


def find_corners(image: Rgb, board: Board) -> Floats | None:
    """Find the inner corners of a board that is seen as a whole.

    Parameters
    ----------
    image : (rows, columns, 3) uint8, RGB.

    Returns
    -------
    (N, 2) float64, px, image frame, in the order of `Board.points`; None if there is no such board.
    """
    import cv2

    grey = np.asarray(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY), np.uint8)
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    found, corners = cv2.findChessboardCornersSB(grey, board.shape, flags=flags)
    if not found:  # the older detector finds some boards that are seen slantwise
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ADAPTIVE_THRESH
        found, corners = cv2.findChessboardCorners(grey, board.shape, flags=flags)
    if not found:
        return None
    ordered = in_order(np.asarray(corners, np.float64).reshape(-1, 2), grey, board)
    return None if ordered is None else _refined(ordered, grey, board)


def spacing_px(corners: Floats, board: Board) -> float:
    """Least distance of two neighbours among the `corners` (N, 2), px, of a board."""
    along, down = board.shape
    grid = corners.reshape(down, along, 2)
    return float(min(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1)))


def _refined(corners: Floats, grey: NDArray[np.uint8], board: Board) -> Floats:
    """The places (N, 2) to which the grey gradients around the `corners` (N, 2) are at right angles.

    The window is as large as the squares admit: on boards seen slantwise the detector is off by up to 1 px, with its
    windows of fixed size, and this one by 0.05 px.
    """
    import cv2

    half = max(int(WINDOW * spacing_px(corners, board)), SMALLEST_WINDOW_PX)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, REFINE_STEPS, REFINED_PX)
    places = corners.astype(np.float32).reshape(-1, 1, 2)
    refined = cv2.cornerSubPix(grey, places, (half, half), (-1, -1), stop)
    return np.asarray(refined, np.float64).reshape(-1, 2)


def in_order(corners: Floats, grey: NDArray[np.uint8], board: Board) -> Floats | None:
    """Put corners (N, 2), px, that run row by row from any corner of the board, in the order of `Board.points`.

    Rows run so that the board is not mirrored, and from the black side to the white one. None if the squares are not
    those of a chessboard.
    """
    along, down = board.shape
    grid = corners.reshape(down, along, 2)
    right, below = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if right[0] * below[1] - right[1] * below[0] < 0.0:
        grid = grid[::-1]
    brightness = _square_brightness(grid, grey)
    row, column = np.indices(brightness.shape)
    white = (row + column) % 2 == 1  # the square between the first four corners is black, as that outside the first
    difference = float(brightness[white].mean() - brightness[~white].mean())
    if difference == 0.0:
        return None
    ordered = grid if difference > 0.0 else grid[::-1, ::-1]
    return np.ascontiguousarray(ordered.reshape(-1, 2))


def _square_brightness(grid: Floats, grey: NDArray[np.uint8]) -> Floats:
    """Grey level in the middle of each square between four inner corners; (down - 1, along - 1)."""
    middles = (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:]) / 4.0
    rows, columns = grey.shape
    i = np.clip(np.rint(middles[..., 0]).astype(int), 1, columns - 2)
    j = np.clip(np.rint(middles[..., 1]).astype(int), 1, rows - 2)
    around = [grey[j + dj, i + di].astype(np.float64) for dj in (-1, 0, 1) for di in (-1, 0, 1)]
    return np.asarray(np.mean(around, axis=0))

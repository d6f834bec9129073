"""What is seen in the pictures of a board: its corners, and the stripe on it; poor pictures are left out."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from footscan.calibration.chessboard.board_stripe import find_stripe, on_board
from footscan.calibration.chessboard.camera_fit import BoardView
from footscan.calibration.chessboard.corners import Board, find_corners, spacing_px
from footscan.calibration.chessboard.pane import Sight
from footscan.calibration.chessboard.pinhole import Pose, fit_pinhole
from footscan.stripe.points import StripePoints

Floats = NDArray[np.float64]
Rgb = NDArray[np.uint8]

FEWEST_CORNERS = 6
"""Corners beside the stripe, in a picture that shows both: a homography needs four."""
POOR, POOR_PX = 4.0, 0.5
"""A picture is left out if its corners lie so many times farther from where the camera would see them than those of the
middle picture, and so many px. Chosen by hand."""


@dataclass(frozen=True)
class BoardShot:
    """The pictures of one pose of the board."""

    name: str
    board: Rgb
    """(rows, columns, 3) uint8, RGB."""
    laser: Rgb | None
    """The same with the stripe; may be `board` itself."""
    off: Rgb | None
    """The view of `laser` without the stripe, if there is one."""
    place: Pose | None


def usable_views(
    shots: Iterable[BoardShot], board: Board, image_px: tuple[int, int]
) -> tuple[list[BoardView], list[str]]:
    """Find the board and the stripe in pictures.

    Returns
    -------
    The views of the board, and a line on each picture that is left out.

    Raises
    ------
    UndeterminedPinholeError
        The views do not determine a camera.
    """
    views: list[BoardView] = []
    stripes: list[StripePoints | None] = []
    remarks: list[str] = []
    for shot in shots:
        corners = find_corners(shot.board, board)
        if corners is None:
            remarks.append(f"{shot.name}: no whole board of {board.squares[0]} x {board.squares[1]} squares; left out")
            continue
        stripe = None if shot.laser is None else find_stripe(shot.laser, shot.off)
        spacing = spacing_px(corners, board)
        apart = np.ones(len(corners), np.bool_)
        if stripe is not None and shot.laser is shot.board:
            apart = _apart(corners, stripe, spacing)
        if np.count_nonzero(apart) < FEWEST_CORNERS:
            remarks.append(f"{shot.name}: the stripe covers the corners of the board; left out")
            continue
        views.append(BoardView(shot.name, board.points[apart], corners[apart], spacing, None, shot.place))
        stripes.append(stripe)
    return _with_stripes(views, stripes, board, image_px, remarks), remarks


def _apart(corners: Floats, stripe: StripePoints, spacing: float) -> NDArray[np.bool_]:
    """Which corners (N, 2), px, the stripe does not disturb; (N,)."""
    if not len(stripe):
        return np.ones(len(corners), np.bool_)
    pixels = np.column_stack([stripe["i"], stripe["j"]]).astype(np.float64)
    distance = cKDTree(pixels).query(corners)[0]
    return np.asarray(distance > spacing / 2.0 + float(np.median(stripe["width"])))


def _with_stripes(
    views: list[BoardView],
    stripes: Sequence[StripePoints | None],
    board: Board,
    image_px: tuple[int, int],
    remarks: list[str],
) -> list[BoardView]:
    """The views that fit one camera, with the stripe on each board; appends to `remarks`."""
    fitted = fit_pinhole([(view.points, view.pixels) for view in views], image_px)
    middle = float(np.median(fitted.errors_px))
    largest = max(POOR * middle, POOR_PX)
    kept = fitted.errors_px <= largest
    if not kept.all():
        remarks += [
            f"{view.name}: the corners lie {error:.2f} px off, in the middle picture {middle:.2f} px; left out"
            for view, error in zip(views, fitted.errors_px, strict=True)
            if error > largest
        ]
        views = list(compress(views, kept))
        stripes = list(compress(stripes, kept))
        fitted = fit_pinhole([(view.points, view.pixels) for view in views], image_px)
    used = []
    for view, stripe, pose in zip(views, stripes, fitted.poses, strict=True):
        found = None if stripe is None else on_board(stripe, board, Sight(fitted.pinhole), pose, view.spacing_px)
        if stripe is not None and found is None:
            remarks.append(f"{view.name}: no stripe across white squares of the board; its stripe is left out")
        used.append(replace(view, stripe=found))
    return used

"""The laser stripe on a chessboard: where in the picture, and where on the board."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.chessboard.corners import Board
from footscan.calibration.chessboard.pane import Sight
from footscan.calibration.chessboard.pinhole import Pose
from footscan.calibration.chessboard.sheet import Plane
from footscan.robust import MAD_TO_SD, TUKEY
from footscan.stripe.extract import extract_stripe
from footscan.stripe.points import StripePoints
from schemas.parameters.extraction import ExtractionParameters

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Rgb = NDArray[np.uint8]

FROM_EDGE_WIDTHS = 0.5
"""Distance of the stripe's points from the edges of their square, in widths of the stripe: at an edge the white side
pulls the centre towards itself. Tuned on the virtual scanner: with 0 the points of a line scatter by 0.02 to 0.3 mm,
with 0.5 by 0.01 to 0.03 mm, and with 1 a third of the lines have too few points."""
LINE_TRIALS = 200
"""Pairs of points through which a line is tried: with a third of the points on the line, one pair in nine lies on it
whole, and all miss it with a chance of 1e-10."""
NEAR_MM = 0.5
"""Distance of points that support a tried line. Chosen by hand."""
LEAST_SD_MM = 0.01
"""Lower bound of the scale of the points about their line, so that exact ones have no outliers. Chosen by hand."""
ROUNDS = 5
"""How often the weights of the points about their line are updated: a bound of time."""
FEWEST_POINTS = 20
"""Points of a line that is used. Chosen by hand."""
LEAST_SQUARES = 2.0
"""Length of a line that is used, in squares: a shorter one has no direction. Chosen by hand."""


@dataclass(frozen=True)
class BoardStripe:
    """The stripe on a board, as far as it is used."""

    pixels: Floats
    """(N, 2) px."""
    square: Ints
    """(N,) number of the square that a point lies on."""


def find_stripe(picture: Rgb, off: Rgb | None) -> StripePoints:
    """Find the stripe in a picture; `off` is the same view without the laser, if there is one."""
    return extract_stripe(picture, ExtractionParameters(), off)


def on_board(points: StripePoints, board: Board, sight: Sight, pose: Pose, spacing_px: float) -> BoardStripe | None:
    """Select the points of the stripe that lie on one line on the white squares of a board.

    On black squares the stripe is dim, and at their edges it is displaced. Of several lines the one with the most
    points is taken.

    Parameters
    ----------
    spacing_px : least distance of neighbouring corners of the board, px.

    Returns
    -------
    None if there are few such points, or if they are close together.
    """
    pixels = np.column_stack([points["i"], points["j"]]).astype(np.float64)
    if not len(pixels):
        return None
    places = pose.undo(board_points(pixels, sight, pose))[:, :2]
    cell = np.floor(places / board.square_mm).astype(np.intp) + 1
    white = board.is_white(cell[:, 0], cell[:, 1])
    within = places / board.square_mm - np.floor(places / board.square_mm)
    from_edge = np.minimum(within, 1.0 - within).min(axis=1) * spacing_px
    usable = np.flatnonzero(white & (from_edge > FROM_EDGE_WIDTHS * points["width"]))
    chosen = usable[_on_one_line(places[usable])]
    if len(chosen) < FEWEST_POINTS or np.ptp(places[chosen], axis=0).max() < LEAST_SQUARES * board.square_mm:
        return None
    return BoardStripe(pixels[chosen], cell[chosen, 1] * board.squares[0] + cell[chosen, 0])


def board_points(pixels: Floats, sight: Sight, pose: Pose) -> Floats:
    """The points (N, 3), mm, camera frame, of a board in its pose that are seen at `pixels` (N, 2)."""
    normal = pose.rotation[:, 2]
    return Plane(normal, float(normal @ pose.translation)).meet(*sight.rays(pixels))


def _on_one_line(places: Floats) -> NDArray[np.bool_]:
    """Which of the `places` (N, 2), mm, lie on the line that most of them lie on; (N,)."""
    if len(places) < 2:
        return np.zeros(len(places), np.bool_)
    random = np.random.default_rng(0)
    pairs = random.integers(0, len(places), (LINE_TRIALS, 2))
    way = places[pairs[:, 1]] - places[pairs[:, 0]]
    length = np.hypot(*way.T)
    way = way[length > 0.0] / length[length > 0.0, np.newaxis]
    starts = places[pairs[length > 0.0, 0]]
    if not len(way):
        return np.zeros(len(places), np.bool_)
    offsets = places[np.newaxis] - starts[:, np.newaxis]
    across = np.abs(offsets[..., 0] * way[:, np.newaxis, 1] - offsets[..., 1] * way[:, np.newaxis, 0])
    distance = across[np.count_nonzero(across < NEAR_MM, axis=1).argmax()]
    weights = (distance < NEAR_MM).astype(np.float64)
    for _ in range(ROUNDS):
        middle = weights @ places / weights.sum()
        rest = places - middle
        normal = np.linalg.eigh(np.einsum("n,np,nq->pq", weights, rest, rest))[1][:, 0]
        distance = np.abs(rest @ normal)
        spread = max(MAD_TO_SD * float(np.median(distance[weights > 0.0])), LEAST_SD_MM)
        weights = (1.0 - np.clip((distance / (TUKEY * spread)) ** 2, None, 1.0)) ** 2
    return np.asarray(weights > 0.0)

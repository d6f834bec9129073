"""Clutter of a film: glints, which stand still while the heads travel, and noise, which appears in one frame only."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from schemas.parameters.extraction import ExtractionParameters

CELL_PX = 4
"""Side of the cells in which a glint is recognised again: its flicker moves its points by less. Chosen by hand."""
FEWEST_FRAMES = 8
"""Films of fewer frames are not searched for glints, and a glint appears in so many frames at least. Chosen by
hand."""
FEWEST_NEIGHBOURS = 3
"""Films of fewer frames are not searched for lonely pieces: an inner frame needs one on either side."""
STATIC_SHARE = 0.5
"""A piece with more than this share of its points in static places is static. Chosen by hand."""
FOLLOWED_SHARE = 0.25
"""A piece with less than this share of its points near the stripe of the frame before or after is lonely. Chosen by
hand."""


def is_moving_stripe(
    centres: NDArray[np.float64],
    frame: NDArray[np.int32],
    piece: NDArray[np.int32],
    frames: int,
    parameters: ExtractionParameters,
) -> NDArray[np.bool_]:
    """Select the points of a film that belong to a moving stripe.

    A glint is a short piece whose place holds short pieces in many frames. Long pieces do not count: the stripe on a
    prism stands still, and the short stripe of a toe may run where that of the forefoot was before. Whole pieces are
    judged, so that a place through which long pieces turn, as around the bend of an ankle, is not taken for a glint.
    Noise is a short piece without a neighbour in the frame before or after.

    Parameters
    ----------
    centres : (N, 2) float64, i and j, px.
    frame : (N,) int32, the frame of each point, ascending from 0, less than `frames`.
    piece : (N,) int32, the piece of each point, numbered through the film.

    Returns
    -------
    (N,) bool, True for points that are kept.

    Examples
    --------
    A piece of three points in one frame of three is short and has no neighbour:

    >>> from schemas.parameters.extraction import ExtractionParameters
    >>> centres = np.array([[50.0, 60.0], [51.0, 60.0], [52.0, 60.0]])
    >>> frame, piece = np.zeros(3, np.int32), np.zeros(3, np.int32)
    >>> print(is_moving_stripe(centres, frame, piece, 3, ExtractionParameters()))
    [False False False]
    """
    if not len(centres):
        return np.zeros(0, np.bool_)
    pieces = int(piece.max()) + 1
    points = np.bincount(piece, minlength=pieces)
    extent = _extents(centres, piece, pieces)
    kept = np.ones(pieces, np.bool_)
    if frames >= FEWEST_FRAMES:
        short = extent < parameters.glint_length_px
        held = _frames_in_place(centres, frame, short[piece], CELL_PX)
        still = held >= max(FEWEST_FRAMES, parameters.glint_share * frames)
        kept &= (np.bincount(piece, still) <= STATIC_SHARE * points) | ~short
    if frames >= FEWEST_NEIGHBOURS:
        followed = _is_followed(centres, frame, kept[piece], frames, parameters.follow_reach_px)
        kept &= (np.bincount(piece, followed) >= FOLLOWED_SHARE * points) | (extent >= parameters.lonely_length_px)
    return kept[piece]


@compiled
def number_pieces(frame: NDArray[np.int32], piece: NDArray[np.float64]) -> NDArray[np.int32]:
    """Number the pieces through the film, without a gap.

    Parameters
    ----------
    frame : (N,) int32, ascending.
    piece : (N,) float64, the number of each point's piece within its frame.

    Returns
    -------
    (N,) int32, from 0.

    Examples
    --------
    >>> print(number_pieces(np.array([0, 0, 1], np.int32), np.array([0.0, 1.0, 0.0])))
    [0 1 2]
    """
    numbers = np.empty(len(frame), np.int32)
    film_number = np.full(int(piece.max()) + 1 if len(piece) else 0, -1, np.int32)
    latest_frame = film_number.copy()
    count = 0
    for a in range(len(frame)):
        number_in_frame = int(piece[a])
        if latest_frame[number_in_frame] != frame[a]:
            latest_frame[number_in_frame] = frame[a]
            film_number[number_in_frame] = count
            count += 1
        numbers[a] = film_number[number_in_frame]
    return numbers


@compiled
def _extents(centres: NDArray[np.float64], piece: NDArray[np.int32], pieces: int) -> NDArray[np.float64]:
    """The larger side of the upright box around each piece, px."""
    low, high = np.full((pieces, 2), np.inf), np.full((pieces, 2), -np.inf)
    for a in range(len(centres)):
        for axis in range(2):
            low[piece[a], axis] = min(low[piece[a], axis], centres[a, axis])
            high[piece[a], axis] = max(high[piece[a], axis], centres[a, axis])
    extent = np.zeros(pieces)
    for p in range(pieces):
        extent[p] = max(high[p, 0] - low[p, 0], high[p, 1] - low[p, 1])
    return extent


@compiled
def _frames_in_place(
    centres: NDArray[np.float64], frame: NDArray[np.int32], counted: NDArray[np.bool_], side: float
) -> NDArray[np.int32]:
    """Count the frames in which each point's square cell, or one beside it, holds a counted point; (N,)."""
    cells = _cells(centres, side)
    shape = cells[:, 0].max() + 2, cells[:, 1].max() + 2
    latest, frames = np.full(shape, -1, np.int32), np.zeros(shape, np.int32)
    for a in range(len(centres)):
        if not counted[a]:
            continue
        for v in range(cells[a, 0] - 1, cells[a, 0] + 2):
            for u in range(cells[a, 1] - 1, cells[a, 1] + 2):
                if latest[v, u] != frame[a]:
                    latest[v, u] = frame[a]
                    frames[v, u] += 1
    in_place = np.empty(len(centres), np.int32)
    for a in range(len(centres)):
        in_place[a] = frames[cells[a, 0], cells[a, 1]]
    return in_place


@compiled
def _is_followed(
    centres: NDArray[np.float64], frame: NDArray[np.int32], kept: NDArray[np.bool_], frames: int, side: float
) -> NDArray[np.bool_]:
    """Select the points with a kept point of the frame before or after in their square cell or in one beside it."""
    cells = _cells(centres, side)
    occupied = np.zeros((frames + 2, cells[:, 0].max() + 2, cells[:, 1].max() + 2), np.bool_)
    for a in range(len(centres)):
        if kept[a]:
            occupied[frame[a] + 1, cells[a, 0], cells[a, 1]] = True
    followed = np.zeros(len(centres), np.bool_)
    for a in range(len(centres)):
        for v in range(cells[a, 0] - 1, cells[a, 0] + 2):
            for u in range(cells[a, 1] - 1, cells[a, 1] + 2):
                if occupied[frame[a], v, u] or occupied[frame[a] + 2, v, u]:
                    followed[a] = True
    return followed


@compiled
def _cells(centres: NDArray[np.float64], side: float) -> NDArray[np.int32]:
    """(N, 2) row and column of the square cell of each point, from 1: a border of empty cells is left."""
    cells = np.empty(centres.shape, np.int32)
    for a in range(len(centres)):
        cells[a, 0] = max(int(centres[a, 1] / side), 0) + 1
        cells[a, 1] = max(int(centres[a, 0] / side), 0) + 1
    return cells

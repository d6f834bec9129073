"""What frames tell of each other: glints stand still while the heads travel, and noise appears in one frame alone."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from schemas.parameters.extraction import ExtractionParameters

CELL_PX = 4
"""A glint's flicker moves its points by less than this."""
FEWEST_FRAMES = 8
"""In fewer frames nothing has stood still."""
FEWEST_NEIGHBOURS = 3
"""Of fewer frames none is held against those beside it."""
STATIC_SHARE = 0.5
"""A piece with more than this share of its points in static places is static."""
FOLLOWED_SHARE = 0.25
"""A piece with less than this share of its points near the stripe of the frame before or after is alone."""


def is_moving_stripe(
    centres: NDArray[np.float64],
    frame: NDArray[np.int32],
    piece: NDArray[np.int32],
    frames: int,
    parameters: ExtractionParameters,
) -> NDArray[np.bool_]:
    """Which of the points of a film belong to a stripe that moves, and moves on.

    A glint is a short piece whose place holds short pieces in many frames. A long piece may stand still: so does the
    stripe on a prism; and a toe's short stripe may run where that of the forefoot stood before. A place through which
    long pieces turn, as around the bend of an ankle, is no glint's either, for it is pieces that are judged. A short
    piece that has none beside it in the frame before nor in the one after is noise.

    Parameters
    ----------
    centres : (N, 2) i, j, px.
    frame : (N,) which frame each is of, ascending from 0; of so many `frames`.
    piece : (N,) which piece, numbered through the film.
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
    """The pieces (N,) of each frame (N,), ascending, numbered through the film without a gap."""
    numbers = np.empty(len(frame), np.int32)
    known = np.full(int(piece.max()) + 1 if len(piece) else 0, -1, np.int32)
    of_frame = known.copy()
    count = 0
    for a in range(len(frame)):
        own = int(piece[a])
        if of_frame[own] != frame[a]:
            of_frame[own] = frame[a]
            known[own] = count
            count += 1
        numbers[a] = known[own]
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
    """For each point, in how many frames there is a counted one in its square cell or in one beside it."""
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
    """Which points have a kept one of the frame before or after in their square cell or in one beside it."""
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
    """(N, 2) row and column of the square cell of each point; the first ones are at 1."""
    cells = np.empty(centres.shape, np.int32)
    for a in range(len(centres)):
        cells[a, 0] = max(int(centres[a, 1] / side), 0) + 1
        cells[a, 1] = max(int(centres[a, 0] / side), 0) + 1
    return cells

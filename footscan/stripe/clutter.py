"""What stands still while the heads travel: glints on the hardware that moves with the cameras."""

import numpy as np
from numpy.typing import NDArray

from footscan.stripe.pieces import connect
from footscan.stripe.points import StripePoints
from schemas.parameters.extraction import ExtractionParameters

CELL_PX = 4.0
"""A glint's flicker moves its points by less than this."""
FEWEST_FRAMES = 8
"""In fewer frames nothing has stood still."""
STATIC_SHARE = 0.5
"""A piece with more than this share of its points in static places is static."""


def on_glint(points: StripePoints, frames: int, parameters: ExtractionParameters) -> NDArray[np.bool_]:
    """Which of (N,) points of a film of so many frames belong to glints.

    A glint is a short piece whose place holds points in many frames. A long piece may stand still: so does the stripe
    on a prism. A place through which long pieces turn, as around the bend of an ankle, is no glint's either, for it is
    pieces that are judged.
    """
    if not len(points):
        return np.zeros(0, np.bool_)
    centres = np.column_stack([points["i"], points["j"]])
    static = _frames_in_place(points["frame"], centres) >= max(FEWEST_FRAMES, parameters.glint_share * frames)
    # Frames side by side, too far apart to touch: the pieces of all frames at once.
    apart = centres + np.outer(points["frame"] * (np.ptp(centres[:, 0]) + 2 * parameters.gap_px), [1.0, 0.0])
    piece = connect(apart, parameters.gap_px)
    share = np.bincount(piece, static) / np.bincount(piece)
    extent = np.max([_extent(piece, axis) for axis in centres.T], axis=0)
    glint: NDArray[np.bool_] = (share > STATIC_SHARE) & (extent < parameters.glint_length_px)
    return glint[piece]


def _frames_in_place(frame: NDArray[np.integer], centres: NDArray[np.float64]) -> NDArray[np.intp]:
    """For each point, in how many frames there is a point in its cell or in one beside it."""
    cells = np.floor(centres / CELL_PX).astype(np.intp)
    cells -= cells.min(axis=0) - 1
    shape = (int(frame.max()) + 1, *(cells.max(axis=0) + 2))
    occupied = np.zeros(shape, np.bool_)
    for step in np.ndindex(3, 3):
        occupied[frame, cells[:, 0] + step[0] - 1, cells[:, 1] + step[1] - 1] = True
    frames: NDArray[np.intp] = occupied.sum(axis=0)[cells[:, 0], cells[:, 1]]
    return frames


def _extent(piece: NDArray[np.intp], values: NDArray[np.float64]) -> NDArray[np.float64]:
    low = np.full(piece.max() + 1, np.inf)
    high = -low
    np.minimum.at(low, piece, values)
    np.maximum.at(high, piece, values)
    return high - low

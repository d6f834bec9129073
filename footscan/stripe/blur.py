"""What a film tells of a piece of one frame: whether the laser has lit it, or the room, which lights the skin's rim.

In a bright room the rim of the skin is lighter and redder than what lies behind it, as a stripe is, and a frame that
the laser does not reach has nothing to hold against it. But the laser's line is narrow, smooth and red, all through a
film. A rim is wide; its place, which the shading of the skin gives, is uncertain; and it is hardly redder than what is
beside it.
"""

import numpy as np
from numpy.typing import NDArray

from footscan.stripe.clutter import FEWEST_FRAMES
from footscan.stripe.extract import FOUND, RED
from schemas.parameters.extraction import ExtractionParameters

WIDTH, SIGMA = FOUND.index("width"), FOUND.index("sigma")
HARDLY_RED = 1.5
"""Thresholds of redness: what is as wide and as uncertain as a rim and below so many is one. Where a tip of the foot
makes the laser's line as wide, it mostly is twice as red."""
BLURRED_SHARE = 0.5
"""A piece with more than this share of its crossings blurred is."""


def is_laser_light(
    crossings: NDArray[np.float64], piece: NDArray[np.int32], frames: int, parameters: ExtractionParameters
) -> NDArray[np.bool_]:
    """Which of the crossings of a film are of pieces that the laser has lit.

    The others are of pieces most of whose crossings exceed `largest_blur` times the film's median width, and as many
    times its median uncertainty, and are hardly red. In films of few frames all are the laser's.

    Parameters
    ----------
    crossings : (N, 10) of all `frames` frames, as `find_stripe` gives them.
    piece : (N,) which piece of the film each is of.
    """
    if frames < FEWEST_FRAMES or not len(crossings):
        return np.ones(len(crossings), np.bool_)
    blurred = crossings[:, RED] < HARDLY_RED * parameters.red_threshold
    for column in (WIDTH, SIGMA):
        blurred &= crossings[:, column] > parameters.largest_blur * np.median(crossings[:, column])
    sharp = np.bincount(piece, blurred) <= BLURRED_SHARE * np.bincount(piece)
    return np.asarray(sharp[piece])

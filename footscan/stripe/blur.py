"""Rejection of pieces that the room has lit, not the laser: rims of skin, and white things.

In a bright room the rim of the skin is lighter and redder than its background, as a stripe is. A frame that the laser
does not reach has no stripe to compare the rim with. But the laser line is narrow, smooth and red throughout a film. A
rim is wide, its place is uncertain (it follows the shading of the skin), and it is hardly redder than its surroundings.

A white thing that saturates the sensor looks like the core of an over-exposed stripe. But a stripe has red flanks, at
least where it is weaker. Where the room alone saturates the red of the skin, no stripe can be redder, and nothing is
known of its colour.

A lit ridge of warm skin is redder than its surroundings because it is brighter in all colours. The laser adds its own
colour and hardly any other, unless it saturates the sensor.
"""

import numpy as np
from numpy.typing import NDArray

from footscan.stripe.clutter import FEWEST_FRAMES
from footscan.stripe.crossings import BRIGHT, CROSSING_COLUMNS, FOOT, RED
from schemas.parameters.extraction import ExtractionParameters

WIDTH, PEAK, SIGMA = (CROSSING_COLUMNS.index(name) for name in ("width", "peak", "sigma"))
HARDLY_RED = 1.5
"""Redness below which a wide and uncertain crossing is blurred, in units of `red_threshold`. Where a tip of the foot
widens the laser line, the line is mostly twice as red. Chosen by hand."""
BLURRED_SHARE = 0.5
"""A piece with more than this share of blurred crossings is blurred. Chosen by hand."""
RED_SHARE = 0.1
"""A piece is white if no more than this share of its crossings is redder than `red_threshold`. Chosen by hand. On films
of a dozen drawn worlds, half of them in bright rooms, it cost less than 0.3 % of the stripe, except in two whose
pictures were white all over (1.3 and 2 %)."""
LEAST_ROOM = 0.5
"""Share of the crossings of a piece beside which red is not saturated, from which its colour is judged: more than half.
Chosen by hand, on the virtual scanner in a bright room, whose skin is saturated beside a third of the stripe."""
PURITY_RANK, PURE, PURE_SHARE = 0.75, 0.5, 0.2
"""The purity of a crossing is the ratio of the grey levels by which it is redder than its surroundings to those by
which it is brighter. It depends on the camera's white balance: in the dark, an automatic one makes the stripe itself
nearly white. A crossing is pure if it has this share (0.5) of the purity that this share (0.75) of the film's crossings
do not exceed. A piece is lit by the room if most of it is not saturated, and less than a fifth of that is pure. Chosen
by hand, on films of 23 drawn worlds: it dropped up to a third of what was no stripe in lit rooms, and at most 0.2 % of
the stripe."""
SATURATES = 25
"""Grey levels below `saturation` from which other colours may grow with the stripe. Chosen by hand."""


def is_laser_light(
    crossings: NDArray[np.float64], piece: NDArray[np.int32], frames: int, parameters: ExtractionParameters
) -> NDArray[np.bool_]:
    """Select the crossings of a film that lie in pieces lit by the laser.

    A piece is rejected if most of its crossings exceed `largest_blur` times the film's median width and `largest_blur`
    times its median uncertainty, and are hardly red; or if hardly any of its crossings is red, or purely red. In films
    of fewer than `FEWEST_FRAMES` frames all pieces are kept.

    Parameters
    ----------
    crossings : (N, 12) float64, the crossings of all `frames` frames, in the columns of `find_stripe`.
    piece : (N,) int32, the number of each crossing's piece in the film, from 0.

    Returns
    -------
    (N,) bool, True for crossings of pieces that are kept.
    """
    if frames < FEWEST_FRAMES or not len(crossings):
        return np.ones(len(crossings), np.bool_)
    blurred = crossings[:, RED] < HARDLY_RED * parameters.red_threshold
    for column in (WIDTH, SIGMA):
        blurred &= crossings[:, column] > parameters.largest_blur * np.median(crossings[:, column])
    points = np.bincount(piece)
    sharp = np.bincount(piece, blurred) <= BLURRED_SHARE * points
    has_room = crossings[:, FOOT] <= parameters.saturation - parameters.red_threshold
    roomy = np.bincount(piece, has_room)
    red = np.bincount(piece, has_room & (crossings[:, RED] >= parameters.red_threshold)) > RED_SHARE * roomy
    red |= roomy <= LEAST_ROOM * points
    measured = crossings[:, PEAK] < parameters.saturation - SATURATES
    purity = crossings[:, RED] / np.maximum(crossings[:, BRIGHT], 1.0)
    usual = np.quantile(purity[measured], PURITY_RANK) if measured.any() else 0.0
    pure = measured & (purity >= PURE * usual)
    unsaturated = np.bincount(piece, measured)
    is_pure = (np.bincount(piece, pure) >= PURE_SHARE * unsaturated) | (unsaturated <= 0.5 * points)
    return np.asarray((sharp & red & is_pure)[piece])

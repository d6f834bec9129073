"""The laser stripe of one frame: what is red against what is merely bright, as sub-pixel points."""

import math
import threading

import numpy as np
from numpy.typing import NDArray

from footscan.stripe.pieces import drop_repeated, keep_stripe
from footscan.stripe.points import STRIPE_DTYPE, StripePoints
from footscan.stripe.profile import CENTRE_I, CENTRE_J, CONTRAST, SYMMETRY, WIDTH, measure_profiles
from footscan.stripe.redness import BLOCK, SIGNAL_SCALE, find_red
from footscan.stripe.ridge import find_ridges, gaussian
from schemas.parameters.extraction import ExtractionParameters


def extract_stripe(image: NDArray[np.uint8], parameters: ExtractionParameters) -> StripePoints:
    """The points of the laser stripe in a frame.

    Parameters
    ----------
    image : (rows, columns, 3) uint8, RGB.

    Returns
    -------
    (N,) of `STRIPE_DTYPE`, frame 0, about one point for each px of the stripe's length, in the order of the rows; empty
    where there is no stripe. The stripe may run in any direction, round corners, and in several pieces.

    Notes
    -----
    Pixels that are redder than their surroundings, with the white core of a saturated stripe, are searched for ridges
    of the Gaussian-smoothed signal (Steger 1998, doi:10.1109/34.659930); the centre is the centre of gravity of the
    profile along the ridge's normal; pieces that are short, weak and far off, or ghosts of a stronger one, are dropped.
    """
    rows, columns, _ = image.shape
    if rows == 0 or columns == 0:
        return np.empty(0, STRIPE_DTYPE)
    buffers = _buffers(rows, columns)
    count = find_red(
        image,
        parameters.red_threshold,
        parameters.saturation,
        round(parameters.largest_width_px),
        buffers.excess,
        buffers.signal,
        buffers.mask,
        buffers.active,
    )
    # A parabola of the smallest contrast and the largest width has this second derivative.
    curvature = 8 * SIGNAL_SCALE * parameters.smallest_contrast / parameters.largest_width_px**2
    ridges = np.empty((count + 1, 5))
    count = find_ridges(
        buffers.signal, buffers.mask, buffers.active, gaussian(parameters.smoothing_px), curvature, ridges
    )
    profiles = np.empty((count + 1, 8))
    count = measure_profiles(
        buffers.signal,
        buffers.excess,
        ridges[:count],
        (
            parameters.largest_width_px,
            SIGNAL_SCALE * parameters.smallest_contrast,
            float(parameters.red_threshold),
            parameters.centre_level,
        ),
        profiles,
    )
    profiles = drop_repeated(profiles[:count], parameters)
    profiles = profiles[keep_stripe(profiles, parameters)]
    return _points(image, profiles, parameters)


class _Buffers(threading.local):
    """Working memory of one thread, used again for every frame of one size."""

    def __init__(self) -> None:
        self.allocate(0, 0)

    def allocate(self, rows: int, columns: int) -> None:
        self.excess = np.empty((rows, columns), np.uint8)
        self.signal = np.empty((rows, columns), np.uint16)
        self.mask = np.empty((rows, columns), np.uint8)
        self.active = np.empty((math.ceil(rows / BLOCK), math.ceil(columns / BLOCK)), np.uint8)


_BUFFERS = _Buffers()


def _buffers(rows: int, columns: int) -> _Buffers:
    if _BUFFERS.mask.shape != (rows, columns):
        _BUFFERS.allocate(rows, columns)
    return _BUFFERS


def _points(image: NDArray[np.uint8], profiles: NDArray[np.float64], parameters: ExtractionParameters) -> StripePoints:
    points = np.zeros(len(profiles), STRIPE_DTYPE)
    points["i"], points["j"] = profiles[:, CENTRE_I], profiles[:, CENTRE_J]
    points["width"] = profiles[:, WIDTH]
    nearest = np.rint(profiles[:, [CENTRE_J, CENTRE_I]]).astype(np.intp)
    points["peak"] = image[nearest[:, 0], nearest[:, 1], 0]
    contrast = profiles[:, CONTRAST] / SIGNAL_SCALE
    points["score"] = contrast / (contrast + parameters.smallest_contrast) * profiles[:, SYMMETRY]
    return points[np.lexsort((points["i"], nearest[:, 0]))]

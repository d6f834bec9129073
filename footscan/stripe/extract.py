"""The laser stripe of one frame, as sub-pixel points."""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.crossings import CHAIN, CROSSING_COLUMNS, find_stripe
from footscan.stripe.laser import adapted_to
from footscan.stripe.plain.skeleton import skeleton_stripe
from footscan.stripe.points import STRIPE_DTYPE, StripePoints
from schemas.parameters.extraction import ExtractionParameters


def extract_stripe(
    image: NDArray[np.uint8], parameters: ExtractionParameters, background: NDArray[np.uint8] | None = None
) -> StripePoints:
    """Extract the points of the laser stripe from a frame.

    Parameters
    ----------
    image : (rows, columns, 3) uint8, RGB.
    parameters : if `laser` is `auto`, they are adapted to the frame, as `footscan.stripe.laser.adapted` does to a film.
    background : the same view with the laser off, of the same shape and type.

    Returns
    -------
    (N,) of `STRIPE_DTYPE`, frame 0: about one point for each px of the stripe's length, piece by piece from one end to
    the other; empty if there is no stripe. The stripe may run in any direction, round corners, and in several pieces.

    Notes
    -----
    Ridges of the Gaussian-smoothed signal are searched for among the pixels that are redder than their surroundings and
    those of the white core of a saturated stripe (`ridge`). The centre is that of the profile along the ridge's normal
    (`profile`, `centre`). Pieces that are short, weak and far off, or ghosts of a stronger piece are dropped
    (`pieces`). The remaining points are smoothed along the stripe, except at corners (`smoothing`).

    Examples
    --------
    A red stripe of three rows, its middle row 30:

    >>> image = np.zeros((64, 64, 3), np.uint8)
    >>> image[29:32, :, 0] = [[100], [200], [100]]
    >>> points = extract_stripe(image, ExtractionParameters())
    >>> print(len(points), bool(np.all(np.abs(points["j"] - 30.0) < 0.01)))
    64 True
    """
    if parameters.laser == "auto":
        parameters = adapted_to([image], parameters, [background])
    if parameters.stripe == "skeleton":
        rows = skeleton_stripe(image, parameters, background)
        return points_of_rows(rows, np.zeros(len(rows), np.int32))
    crossings = find_stripe(image, parameters, background)
    return as_points(crossings, np.zeros(len(crossings), np.int32))


def as_points(crossings: NDArray[np.float64], frame: NDArray[np.int32]) -> StripePoints:
    """Convert crossings to stripe points at whole columns or rows.

    Crossings lie between two columns, or rows, and two pixels apart, or four where one was missed. Points are put where
    the straight line from one crossing to the next passes a column, or row.

    Parameters
    ----------
    crossings : (N, 12) float64, of one frame or several, in the columns of `find_stripe`.
    frame : (N,) int32, the frame of each crossing, ascending.

    Returns
    -------
    (M,) of `STRIPE_DTYPE`.
    """
    return points_of_rows(*_on_lines(crossings, frame))


def points_of_rows(rows: NDArray[np.float64], frame: NDArray[np.int32]) -> StripePoints:
    """Stripe points from rows (N, 7) of `CROSSING_COLUMNS`, and the frame of each."""
    points = np.empty(len(rows), STRIPE_DTYPE)
    points["frame"] = frame
    for column, name in enumerate(CROSSING_COLUMNS):
        points[name] = rows[:, column]
    return points


@compiled
def _on_lines(
    crossings: NDArray[np.float64], frame: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Interpolate each chain of crossings at the whole columns, or rows, that it passes; points and their frames."""
    count = len(crossings)
    most = 0
    for a in range(count):
        most += 2
        if _follows(crossings, frame, a):
            most += int(max(abs(crossings[a, 0] - crossings[a - 1, 0]), abs(crossings[a, 1] - crossings[a - 1, 1])))
    points, frames = np.empty((most, len(CROSSING_COLUMNS))), np.empty(most, np.int32)
    filled = 0
    for a in range(count):
        is_last = a + 1 == count or not _follows(crossings, frame, a + 1)
        if not _follows(crossings, frame, a):
            if is_last:
                points[filled] = crossings[a, : len(CROSSING_COLUMNS)]
                frames[filled] = frame[a]
                filled += 1
            continue
        axis = 0 if abs(crossings[a, 0] - crossings[a - 1, 0]) >= abs(crossings[a, 1] - crossings[a - 1, 1]) else 1
        start, end = crossings[a - 1, axis], crossings[a, axis]
        way = 1.0 if end >= start else -1.0
        # A chain reaches half a pixel beyond its first and its last crossing.
        is_first = not _follows(crossings, frame, a - 1)
        reach_from = start - 0.5 * way if is_first else start
        reach_to = end + 0.5 * way if is_last else end
        line = math.ceil(reach_from) if way > 0 else math.floor(reach_from)
        if line == reach_from and not is_first:
            line += way  # the previous pair of crossings put a point on this line
        while (reach_to - line) * way >= 0 and start != end:
            part = (line - start) / (end - start)
            frames[filled] = frame[a]
            for column in range(len(CROSSING_COLUMNS)):
                inside = part if column < 2 else min(max(part, 0.0), 1.0)
                points[filled, column] = (1 - inside) * crossings[a - 1, column] + inside * crossings[a, column]
            points[filled, axis] = line
            filled += 1
            line += way
    return points[:filled], frames[:filled]


@compiled
def _follows(crossings: NDArray[np.float64], frame: NDArray[np.int32], a: int) -> bool:
    """Whether crossing `a` continues the chain of the crossing before it."""
    return a > 0 and frame[a] == frame[a - 1] and crossings[a, CHAIN] == crossings[a - 1, CHAIN]

"""The laser stripe of one frame, as sub-pixel points."""

import math
import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.chain import in_order, is_sharpest, neighbours, pieces_of, place
from footscan.stripe.loop_parameters import LoopParameters, loop_parameters_of
from footscan.stripe.pieces import keep_stripe
from footscan.stripe.points import STRIPE_DTYPE, StripePoints
from footscan.stripe.profile import COLUMNS, CONTRAST, REDNESS, SATURATION, SYMMETRY, WIDTH, measure_profiles
from footscan.stripe.redness import SIGNAL_SCALE, as_red, as_words, halve, mark_saturated, red_of, take_away
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, I, J, find_ridges, gaussian
from footscan.stripe.smoothing import smooth_along
from schemas.parameters.extraction import ExtractionParameters


def extract_stripe(
    image: NDArray[np.uint8], parameters: ExtractionParameters, background: NDArray[np.uint8] | None = None
) -> StripePoints:
    """Extract the points of the laser stripe from a frame.

    Parameters
    ----------
    image : (rows, columns, 3) uint8, RGB.
    parameters : `laser` is taken for red if it is `auto`: `footscan.stripe.laser` finds it, in several frames.
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
    crossings = find_stripe(image, parameters, background)
    return as_points(crossings, np.zeros(len(crossings), np.int32))


CROSSING_COLUMNS = ("i", "j", "width", "peak", "score", "saturation", "sigma")
"""The first columns of `find_stripe`, named as the fields of `STRIPE_DTYPE`."""
PIECE, CHAIN, RED, BRIGHT = range(len(CROSSING_COLUMNS), len(CROSSING_COLUMNS) + 4)
"""The other columns of `find_stripe`: the numbers of the piece and of the chain, by how many grey levels the stripe
is redder than its feet, and by how many it is brighter."""
MEASURED = BRIGHT + 1
"""Number of columns of `find_stripe`."""


def find_stripe(
    image: NDArray[np.uint8], parameters: ExtractionParameters, background: NDArray[np.uint8] | None = None
) -> NDArray[np.float64]:
    """Measure the crossings of a frame's stripe, two pixels apart; parameters as for `extract_stripe`.

    Returns
    -------
    (N, 11) float64, one crossing a row, in the columns of `CROSSING_COLUMNS`, `PIECE`, `CHAIN`, `RED` and `BRIGHT`.
    Crossings of one chain follow each other along the stripe; chains of one piece lie close to each other.
    """
    rows, columns, _ = image.shape
    if rows == 0 or columns == 0:
        return np.empty((0, MEASURED))
    laser = parameters.searched_laser
    words = as_red(as_words(image), laser)
    light = words
    if background is not None:
        light = np.empty((rows, columns), np.uint32)
        dark = as_red(as_words(background), laser)
        take_away(*(part.view(np.uint8).ravel() for part in (words, dark, light)))
    return np.asarray(
        _find_points(
            words,
            light,
            background is not None,
            _memory(rows, columns),
            gaussian(0.5 * parameters.ridge_px),
            loop_parameters_of(parameters),
            (
                SIGNAL_SCALE * parameters.smallest_contrast,
                float(parameters.shortest_piece_px),
                parameters.ghost_reach_px,
                parameters.ghost_strength,
                parameters.group_gap_px,
                parameters.smallest_group,
            ),
            parameters.gap_px,
            parameters.smoothing_widths,
        )
    )


def as_points(crossings: NDArray[np.float64], frame: NDArray[np.int32]) -> StripePoints:
    """Convert crossings to stripe points at whole columns or rows.

    Crossings lie between two columns, or rows, and two pixels apart, or four where one was missed. Points are put where
    the straight line from one crossing to the next passes a column, or row.

    Parameters
    ----------
    crossings : (N, 11) float64, of one frame or several, in the columns of `find_stripe`.
    frame : (N,) int32, the frame of each crossing, ascending.

    Returns
    -------
    (M,) of `STRIPE_DTYPE`.
    """
    filled, frames = _on_lines(crossings, frame)
    points = np.empty(len(filled), STRIPE_DTYPE)
    points["frame"] = frames
    for column, name in enumerate(CROSSING_COLUMNS):
        points[name] = filled[:, column]
    return points


RIDGES_A_LINE = 8
"""Ridge crossings for which memory is kept, a row and a column of the half-size image: a bound of memory. A frame with
more of them gets memory of its own."""


class Memory(NamedTuple):
    """Working memory for a frame of (rows, columns)."""

    excess: NDArray[np.uint16]
    """(ceil(rows / 2), ceil(columns / 2)): the redness of `halve`."""
    signal: NDArray[np.uint16]
    """(ceil(rows / 2), ceil(columns / 2)): the signal of `halve`."""
    ridges: NDArray[np.float64]
    """(M, 5): the columns of `find_ridges`."""


class _Buffers(threading.local):
    """Working memory of one thread, reused for all frames of one size."""

    def __init__(self) -> None:
        self.allocate(0, 0)

    def allocate(self, rows: int, columns: int) -> None:
        self.shape = rows, columns
        half = math.ceil(rows / 2), math.ceil(columns / 2)
        ridges = np.empty((RIDGES_A_LINE * sum(half), 5))
        self.memory = Memory(np.empty(half, np.uint16), np.empty(half, np.uint16), ridges)


_BUFFERS = _Buffers()


def _memory(rows: int, columns: int) -> Memory:
    if _BUFFERS.shape != (rows, columns):
        _BUFFERS.allocate(rows, columns)
    return _BUFFERS.memory


@compiled
def _find_points(
    words: NDArray[np.uint32],
    light: NDArray[np.uint32],
    has_background: bool,
    memory: Memory,
    kernel: NDArray[np.float32],
    limits: LoopParameters,
    piece_limits: tuple[float, float, float, float, float, float],
    gap: float,
    smoothing_widths: float,
) -> NDArray[np.float64]:
    rows, columns = words.shape
    excess, signal, ridges = memory
    halve(light, limits.saturation, excess, signal)
    if has_background:
        mark_saturated(words, limits.saturation, excess)
    count = find_ridges(excess, signal, kernel, limits, ridges)
    if count > len(ridges):
        ridges = np.empty((count, 5))
        count = find_ridges(excess, signal, kernel, limits, ridges)
    profiles = np.empty((count + 1, COLUMNS))
    profiles = profiles[: measure_profiles(words, light, ridges[:count], limits, profiles)]

    profiles = profiles[is_sharpest(profiles, place(profiles, rows, columns))]
    piece, pieces = pieces_of(profiles, gap, place(profiles, rows, columns))
    kept = keep_stripe(profiles, piece, pieces, *piece_limits)
    profiles, piece = profiles[kept], piece[kept]
    nearest = neighbours(profiles, gap, place(profiles, rows, columns))
    order, chain = in_order(profiles, nearest)
    profiles, piece = profiles[order], piece[order]
    moves, sigmas = smooth_along(profiles, chain, smoothing_widths)
    return _rows(words, profiles, moves, sigmas, piece, chain, SIGNAL_SCALE * limits.faintest)


@compiled
def _rows(
    words: NDArray[np.uint32],
    profiles: NDArray[np.float64],
    moves: NDArray[np.float64],
    sigmas: NDArray[np.float64],
    piece: NDArray[np.int32],
    chain: NDArray[np.int32],
    faintest: float,
) -> NDArray[np.float64]:
    """(N, 11): the columns of `CROSSING_COLUMNS`, `PIECE`, `CHAIN`, `RED` and `BRIGHT`."""
    crossings = np.empty((len(profiles), MEASURED))
    rows, columns = words.shape
    for a in range(len(profiles)):
        i, j = profiles[a, I], profiles[a, J]
        # A hundredth of a pixel inside the border, so that rounding gives a pixel of the image.
        crossings[a, 0] = min(max(i + moves[a] * profiles[a, NORMAL_I], -0.49), columns - 0.51)
        crossings[a, 1] = min(max(j + moves[a] * profiles[a, NORMAL_J], -0.49), rows - 0.51)
        crossings[a, 2] = profiles[a, WIDTH]
        crossings[a, 3] = red_of(words[min(max(round(j), 0), rows - 1), min(max(round(i), 0), columns - 1)])
        crossings[a, 4] = profiles[a, CONTRAST] / (profiles[a, CONTRAST] + faintest) * profiles[a, SYMMETRY]
        crossings[a, 5] = profiles[a, SATURATION]
        crossings[a, 6] = sigmas[a]
        crossings[a, PIECE] = piece[a]
        crossings[a, CHAIN] = chain[a]
        crossings[a, RED] = profiles[a, REDNESS]
        crossings[a, BRIGHT] = profiles[a, CONTRAST] / SIGNAL_SCALE
    return crossings


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

"""The laser stripe of one frame: what is red against what is merely bright, as sub-pixel points."""

import math
import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.chain import in_order, is_sharpest, neighbours, pieces_of, place
from footscan.stripe.limits import Limits, limits_of
from footscan.stripe.pieces import keep_stripe
from footscan.stripe.points import STRIPE_DTYPE, StripePoints
from footscan.stripe.profile import COLUMNS, CONTRAST, REDNESS, SATURATION, SYMMETRY, WIDTH, measure_profiles
from footscan.stripe.redness import SIGNAL_SCALE, as_words, halve, mark_saturated, red_of, take_away
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, I, J, find_ridges, gaussian
from footscan.stripe.smoothing import smooth_along
from schemas.parameters.extraction import ExtractionParameters


def extract_stripe(
    image: NDArray[np.uint8], parameters: ExtractionParameters, background: NDArray[np.uint8] | None = None
) -> StripePoints:
    """The points of the laser stripe in a frame.

    Parameters
    ----------
    image : (rows, columns, 3) uint8, RGB.
    background : the same view with the laser off, of the same shape.

    Returns
    -------
    (N,) of `STRIPE_DTYPE`, frame 0, about one point for each px of the stripe's length, piece by piece from one end to
    the other; empty where there is no stripe. The stripe may run in any direction, round corners, and in several
    pieces.

    Notes
    -----
    Pixels that are redder than their surroundings, and the white core of a saturated stripe, are searched for ridges of
    the Gaussian-smoothed signal (`ridge`); the centre is that of the profile along the ridge's normal (`profile`,
    `centre`); pieces that are short, weak and far off, or ghosts of a stronger one, are dropped (`pieces`); what
    remains is smoothed along the stripe, except at corners (`smoothing`).
    """
    found = find_stripe(image, parameters, background)
    return as_points(found, np.zeros(len(found), np.int32))


FOUND = ("i", "j", "width", "peak", "score", "saturation", "sigma")
"""The first columns of what `find_stripe` gives."""
PIECE, CHAIN, RED = range(len(FOUND), len(FOUND) + 3)
"""Its others: the numbers of the piece and of the chain, and how many grey levels redder than its feet a stripe is."""
MEASURED = RED + 1


def find_stripe(
    image: NDArray[np.uint8], parameters: ExtractionParameters, background: NDArray[np.uint8] | None = None
) -> NDArray[np.float64]:
    """(N, 10): where the stripe of a frame was measured, in the columns of `FOUND`, `PIECE`, `CHAIN` and `RED`.

    Crossings of one chain follow each other along the stripe; chains of one piece lie close to each other.
    """
    rows, columns, _ = image.shape
    if rows == 0 or columns == 0:
        return np.empty((0, MEASURED))
    words = as_words(image)
    light = words
    if background is not None:
        light = np.empty((rows, columns), np.uint32)
        take_away(*(part.view(np.uint8).ravel() for part in (words, as_words(background), light)))
    return np.asarray(
        _find_points(
            words,
            light,
            background is not None,
            _memory(rows, columns),
            gaussian(0.5 * parameters.ridge_px),
            limits_of(parameters),
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


def as_points(found: NDArray[np.float64], frame: NDArray[np.int32]) -> StripePoints:
    """Points from the crossings (N, 10) that `find_stripe` gave for each frame (N,).

    Crossings lie two pixels apart between two columns, or rows, or four where one was missed; points are put onto the
    straight line from each to the next where that passes a column, or row.
    """
    filled, frames = _on_lines(found, frame)
    points = np.empty(len(filled), STRIPE_DTYPE)
    points["frame"] = frames
    for column, name in enumerate(FOUND):
        points[name] = filled[:, column]
    return points


class Memory(NamedTuple):
    """What a frame of (rows, columns) is worked out in."""

    excess: NDArray[np.uint16]
    signal: NDArray[np.uint16]
    """Both (ceil(rows / 2), ceil(columns / 2))."""
    ridges: NDArray[np.float64]
    """(M, 5)."""


class _Buffers(threading.local):
    """Working memory of one thread, used again for every frame of one size."""

    def __init__(self) -> None:
        self.allocate(0, 0)

    def allocate(self, rows: int, columns: int) -> None:
        self.shape = rows, columns
        half = math.ceil(rows / 2), math.ceil(columns / 2)
        self.memory = Memory(np.empty(half, np.uint16), np.empty(half, np.uint16), np.empty((8 * sum(half), 5)))


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
    limits: Limits,
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
    """(N, 10): the columns of `FOUND`, `PIECE`, `CHAIN` and `RED`."""
    found = np.empty((len(profiles), MEASURED))
    rows, columns = words.shape
    for a in range(len(profiles)):
        i, j = profiles[a, I], profiles[a, J]
        # Short of the border by a little: the line half a pixel on is still one of the image's.
        found[a, 0] = min(max(i + moves[a] * profiles[a, NORMAL_I], -0.49), columns - 0.51)
        found[a, 1] = min(max(j + moves[a] * profiles[a, NORMAL_J], -0.49), rows - 0.51)
        found[a, 2] = profiles[a, WIDTH]
        found[a, 3] = red_of(words[min(max(round(j), 0), rows - 1), min(max(round(i), 0), columns - 1)])
        found[a, 4] = profiles[a, CONTRAST] / (profiles[a, CONTRAST] + faintest) * profiles[a, SYMMETRY]
        found[a, 5] = profiles[a, SATURATION]
        found[a, 6] = sigmas[a]
        found[a, PIECE] = piece[a]
        found[a, CHAIN] = chain[a]
        found[a, RED] = profiles[a, REDNESS]
    return found


@compiled
def _on_lines(found: NDArray[np.float64], frame: NDArray[np.int32]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Crossings, each chain of them taken at the whole columns, or rows, that it passes; the frame of each point."""
    count = len(found)
    most = 0
    for a in range(count):
        most += 2
        if _follows(found, frame, a):
            most += int(max(abs(found[a, 0] - found[a - 1, 0]), abs(found[a, 1] - found[a - 1, 1])))
    points, frames = np.empty((most, len(FOUND))), np.empty(most, np.int32)
    filled = 0
    for a in range(count):
        is_last = a + 1 == count or not _follows(found, frame, a + 1)
        if not _follows(found, frame, a):
            if is_last:
                points[filled] = found[a, : len(FOUND)]
                frames[filled] = frame[a]
                filled += 1
            continue
        axis = 0 if abs(found[a, 0] - found[a - 1, 0]) >= abs(found[a, 1] - found[a - 1, 1]) else 1
        start, end = found[a - 1, axis], found[a, axis]
        way = 1.0 if end >= start else -1.0
        # A crossing stands for half a pixel beyond it, where the chain ends.
        is_first = not _follows(found, frame, a - 1)
        reach_from = start - 0.5 * way if is_first else start
        reach_to = end + 0.5 * way if is_last else end
        line = math.ceil(reach_from) if way > 0 else math.floor(reach_from)
        if line == reach_from and not is_first:
            line += way  # that line had its point
        while (reach_to - line) * way >= 0 and start != end:
            part = (line - start) / (end - start)
            frames[filled] = frame[a]
            for column in range(len(FOUND)):
                inside = part if column < 2 else min(max(part, 0.0), 1.0)
                points[filled, column] = (1 - inside) * found[a - 1, column] + inside * found[a, column]
            points[filled, axis] = line
            filled += 1
            line += way
    return points[:filled], frames[:filled]


@compiled
def _follows(found: NDArray[np.float64], frame: NDArray[np.int32], a: int) -> bool:
    """Whether crossing `a` comes next after the one before it."""
    return a > 0 and frame[a] == frame[a - 1] and found[a, CHAIN] == found[a - 1, CHAIN]

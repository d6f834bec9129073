"""The crossings of the laser stripe of one frame: where it is measured, two pixels apart, and in which pieces."""

import math
import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.chain import in_order, is_sharpest, neighbours, pieces_of, place
from footscan.stripe.faint import find_line
from footscan.stripe.loop_parameters import LoopParameters, loop_parameters_of
from footscan.stripe.pieces import keep_stripe
from footscan.stripe.profile import COLUMNS, CONTRAST, REDNESS, SATURATION, SYMMETRY, WIDTH, measure_profiles
from footscan.stripe.redness import SIGNAL_SCALE, as_red, as_words, halve, mark_saturated, red_of, take_away
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, I, J, find_ridges, gaussian
from footscan.stripe.smoothing import smooth_along
from schemas.parameters.extraction import ExtractionParameters

CROSSING_COLUMNS = ("i", "j", "width", "peak", "score", "saturation", "sigma")
"""The first columns of `find_stripe`, named as the fields of `STRIPE_DTYPE`."""
PIECE, CHAIN, RED, BRIGHT, FOOT = range(len(CROSSING_COLUMNS), len(CROSSING_COLUMNS) + 5)
"""The other columns of `find_stripe`: the numbers of the piece and of the chain, by how many grey levels the stripe
is redder than its feet, by how many it is brighter, and the red of the darker one of the surroundings on both sides."""
MEASURED = FOOT + 1
"""Number of columns of `find_stripe`."""
BESIDE_WIDTHS = 1.5
"""Distance from the centre at which the surroundings of a stripe are, in its widths: a Gaussian has faded there to
0.2 %."""


def find_stripe(
    image: NDArray[np.uint8], parameters: ExtractionParameters, background: NDArray[np.uint8] | None = None
) -> NDArray[np.float64]:
    """Measure the crossings of a frame's stripe, two pixels apart.

    Parameters
    ----------
    image, background : as for `extract_stripe`.
    parameters : as `footscan.stripe.laser.adapted` returns them. A laser that is `auto` is taken for red, a stripe that
        is `auto` for clear.

    Returns
    -------
    (N, 12) float64, one crossing a row, in the columns of `CROSSING_COLUMNS`, `PIECE`, `CHAIN`, `RED`, `BRIGHT` and
    `FOOT`. Crossings of one chain follow each other along the stripe; chains of one piece lie close to each other.
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
    limits = loop_parameters_of(parameters)
    kernel = gaussian(0.5 * parameters.ridge_px)
    if parameters.stripe == "faint":
        profiles, piece = find_line(light, kernel, limits, parameters.gap_px, float(parameters.shortest_piece_px))
        return np.asarray(_along(words, profiles, piece, limits, parameters.gap_px, parameters.smoothing_widths))
    return np.asarray(
        _find_points(
            words,
            light,
            background is not None,
            _memory(rows, columns),
            kernel,
            limits,
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
    return _along(words, profiles[kept], piece[kept], limits, gap, smoothing_widths)


@compiled
def _along(
    words: NDArray[np.uint32],
    profiles: NDArray[np.float64],
    piece: NDArray[np.int32],
    limits: LoopParameters,
    gap: float,
    smoothing_widths: float,
) -> NDArray[np.float64]:
    """Order the profiles along the stripe and smooth their centres; (N, 12), see `find_stripe`."""
    rows, columns = words.shape
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
    """(N, 12): the columns of `CROSSING_COLUMNS`, `PIECE`, `CHAIN`, `RED`, `BRIGHT` and `FOOT`."""
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
        beside = BESIDE_WIDTHS * profiles[a, WIDTH]
        foot = 255
        for side in (-beside, beside):
            row = min(max(round(j + side * profiles[a, NORMAL_J]), 0), rows - 1)
            column = min(max(round(i + side * profiles[a, NORMAL_I]), 0), columns - 1)
            foot = min(foot, red_of(words[row, column]))
        crossings[a, FOOT] = foot
    return crossings

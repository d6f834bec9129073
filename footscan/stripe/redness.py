"""What is red against what is merely bright, or red all over: the pixels where the stripe may lie."""

import numba
import numpy as np
from numpy.typing import NDArray

BLOCK = 32
"""Side in px of the blocks whose own redness a pixel must exceed: wider than a stripe, narrower than a red thing."""
BACKGROUND_PART = 0.1
"""The quantile of redness that is a block's own: the widest stripe leaves more of the block uncovered."""
SIGNAL_SCALE = 4
"""Levels of the signal for one grey level: it is 2 R + G + B, for the laser's red and a saturated core's white."""


@numba.njit(cache=True, nogil=True)
def find_red(
    image: NDArray[np.uint8],
    red_threshold: int,
    saturation: int,
    largest_core: int,
    excess: NDArray[np.uint8],
    signal: NDArray[np.uint16],
    mask: NDArray[np.uint8],
    active: NDArray[np.uint8],
) -> int:
    """Fills `excess`, `signal` and `mask`, (rows, columns), and `active`, (blocks,), for an RGB image; the mask's size.

    `excess` is R - max(G, B), `signal` 2 R + G + B; `mask` is 1 where the stripe may lie: where the excess is larger
    than that of its surroundings, and in saturated runs between two such pixels of a row or a column.
    """
    background = np.zeros(active.shape, np.float32)
    _measure_blocks(image, excess, signal, background)
    mask[:] = 0
    _exceed_background(excess, background, red_threshold, mask)
    _fill_cores(image, saturation, largest_core, mask)
    active[:] = 0
    count = 0
    for j in range(mask.shape[0]):
        for i in range(mask.shape[1]):
            if mask[j, i]:
                count += 1
                active[j // BLOCK, i // BLOCK] = 1
    return count


@numba.njit(cache=True, nogil=True)
def _measure_blocks(
    image: NDArray[np.uint8],
    excess: NDArray[np.uint8],
    signal: NDArray[np.uint16],
    background: NDArray[np.float32],
) -> None:
    rows, columns = excess.shape
    counts = np.zeros(256, np.int32)
    for block_j in range(background.shape[0]):
        for block_i in range(background.shape[1]):
            counts[:] = 0
            j_end, i_end = min(rows, (block_j + 1) * BLOCK), min(columns, (block_i + 1) * BLOCK)
            for j in range(block_j * BLOCK, j_end):
                for i in range(block_i * BLOCK, i_end):
                    red, green, blue = np.int32(image[j, i, 0]), np.int32(image[j, i, 1]), np.int32(image[j, i, 2])
                    redness = np.int32(np.maximum(red - np.maximum(green, blue), 0))
                    excess[j, i] = redness
                    signal[j, i] = 2 * red + green + blue
                    counts[redness] += 1
            wanted = BACKGROUND_PART * (j_end - block_j * BLOCK) * (i_end - block_i * BLOCK)
            level, below = 0, counts[0]
            while below < wanted:
                level += 1
                below += counts[level]
            background[block_j, block_i] = level


@numba.njit(cache=True, nogil=True)
def _exceed_background(
    excess: NDArray[np.uint8], background: NDArray[np.float32], red_threshold: int, mask: NDArray[np.uint8]
) -> None:
    """Marks what exceeds the background, which is interpolated between the centres of the blocks."""
    last_j, last_i = background.shape[0] - 1, background.shape[1] - 1
    for j in range(excess.shape[0]):
        v = min(max((j + 0.5) / BLOCK - 0.5, 0.0), float(last_j))
        j0 = min(int(v), max(last_j - 1, 0))
        j1, weight_j = min(j0 + 1, last_j), v - j0
        for i in range(excess.shape[1]):
            if excess[j, i] < red_threshold:
                continue
            u = min(max((i + 0.5) / BLOCK - 0.5, 0.0), float(last_i))
            i0 = min(int(u), max(last_i - 1, 0))
            i1, weight_i = min(i0 + 1, last_i), u - i0
            upper = (1 - weight_i) * background[j0, i0] + weight_i * background[j0, i1]
            lower = (1 - weight_i) * background[j1, i0] + weight_i * background[j1, i1]
            if excess[j, i] - ((1 - weight_j) * upper + weight_j * lower) >= red_threshold:
                mask[j, i] = 1


@numba.njit(cache=True, nogil=True)
def _fill_cores(image: NDArray[np.uint8], saturation: int, largest_core: int, mask: NDArray[np.uint8]) -> None:
    """Marks the white core of a saturated stripe: a run of saturated pixels from one red flank to the other."""
    rows, columns = mask.shape
    # How many saturated pixels lie between this one and the last red one of its column; -1: some were not saturated.
    above = np.full(columns, -1, np.int32)
    for j in range(rows):
        before = -1
        for i in range(columns):
            if mask[j, i]:
                if 0 < before <= largest_core:
                    mask[j, i - before : i] = 1
                if 0 < above[i] <= largest_core:
                    mask[j - above[i] : j, i] = 1
                before = above[i] = 0
            elif image[j, i, 0] >= saturation:
                before += before >= 0
                above[i] += above[i] >= 0
            else:
                before = above[i] = -1

"""The ridge of the stripe: where the smoothed signal is highest across it, and which way across is.

C. Steger, "An unbiased detector of curvilinear structures", IEEE TPAMI 20(2), 1998, doi:10.1109/34.659930. The Hessian
gives the normal; the centre is left to the profile along it (`footscan.stripe.profile`).
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.limits import Limits
from footscan.stripe.redness import SATURATED, SIGNAL_SCALE, SUMMED

SIDE = 16
"""Blocks and a border of one pixel, in px of the half-size image: as many numbers as the widest instructions take."""
BLOCK = SIDE - 2
"""Side of the blocks whose own light a pixel must exceed: wider than a stripe, narrower than a red thing."""
RADIUS = 4
PATCH = SIDE + 2 * RADIUS
"""Pixels that the smoothed block and its border are made of."""
TAPS = 2 * RADIUS + 1
"""Weights of the smoothing: a number that the compiler knows lets it unroll the loops."""
BACKGROUND_PART = 0.1
"""The quantile of its pixels that is a block's own light: the widest stripe leaves more of the block uncovered."""
SAMPLED = 2
"""One pixel in so many of a row, and one row in so many, tell a block's own light."""
OBLIQUE = 0.9
"""Near 45 degrees a ridge is looked for along rows and along columns, lest one direction leave it to the other."""
ROUND = 0.5
"""Curvature along the ridge, relative to that across, from which it is a spot or the end of a stripe."""
DOWN, ACROSS = 1, 2
"""Of a summit: highest down its column, across its row."""
SPACING_PX = 2
"""Distance of crossings along the stripe, as far as that runs along rows or columns."""
I, J, NORMAL_I, NORMAL_J, SHARPNESS = range(5)  # noqa: E741 (the name of the axis)
"""Columns of what `find_ridges` writes."""


@lru_cache
def gaussian(sigma: float) -> NDArray[np.float32]:
    """The `TAPS` weights of a Gaussian, `sigma` in px, at most half of `RADIUS`."""
    # By the C library: NumPy's exp differs in its last digits from processor to processor.
    weights = np.array([math.exp(-0.5 * (k / sigma) ** 2) for k in range(-RADIUS, RADIUS + 1)])
    return np.asarray(weights / weights.sum(), np.float32)


@compiled
def find_ridges(
    excess: NDArray[np.uint16],
    signal: NDArray[np.uint16],
    kernel: NDArray[np.float32],
    limits: Limits,
    ridges: NDArray[np.float64],
) -> int:
    """Writes the ridge crossings of a frame into `ridges`, (capacity, 5); how many there are.

    Ridges are looked for in the half-size image of `halve`, which `kernel` smooths: mosaic and JPEG tell the colour of
    four pixels together. A stripe that runs along the rows is crossed once in two columns of the whole image, between
    these, and one that runs along the columns once in two rows. Looked at are pixels that are redder than the block
    they lie in by the red threshold, and those whose red is saturated and can tell nothing.
    Of the rows written, i and j are the crossing in px, then the unit normal and the curvature across, levels of the
    signal per px^2. Crossings beyond the capacity are counted and not written.
    """
    patch = np.empty((PATCH, PATCH), np.float32)
    along = np.empty((PATCH, SIDE), np.float32)
    smooth = np.empty((SIDE, SIDE), np.float32)
    summits = np.empty((SIDE, SIDE), np.uint8)
    counts = np.empty(SUMMED * 255 + 1, np.int32)
    crossing = np.empty(5)
    threshold, brighter = SUMMED * limits.red_threshold, SUMMED * SIGNAL_SCALE * limits.faintest
    # A parabola's second derivative, in half-size pixels.
    least = 4 * 8 * SUMMED * SIGNAL_SCALE * limits.faintest / limits.largest_width**2
    lowest_red, highest_red = np.empty(excess.shape[1], np.uint16), np.empty(excess.shape[1], np.uint16)
    count = 0
    for top in range(0, excess.shape[0], BLOCK):
        bottom = min(excess.shape[0], top + BLOCK)
        _measure_range(excess[top:bottom], lowest_red, highest_red)
        for left in range(0, excess.shape[1], BLOCK):
            right = min(excess.shape[1], left + BLOCK)
            least_red, most_red = lowest_red[left], highest_red[left]
            for u in range(left + 1, right):
                least_red, most_red = min(least_red, lowest_red[u]), max(most_red, highest_red[u])
            if int(most_red) - int(least_red) < threshold and (
                most_red < SATURATED or _contrast(signal[top:bottom, left:right]) < brighter
            ):
                continue
            redder = threshold + _own_redness(excess[top:bottom, left:right], counts)
            _cut_out(signal, top - 1 - RADIUS, left - 1 - RADIUS, patch)
            _smooth(patch, kernel, along, smooth)
            _mark_summits(smooth, summits)
            for y in range(1, bottom - top + 1):
                for x in range(1, right - left + 1):
                    if not summits[y, x]:
                        continue
                    v, u = top + y - 1, left + x - 1
                    if excess[v, u] < redder:
                        continue
                    if not _cross(smooth, x, y, summits[y, x], least, crossing):
                        continue
                    if count < len(ridges):
                        ridges[count] = crossing
                        ridges[count, I] = 2 * (u + crossing[I]) + 0.5
                        ridges[count, J] = 2 * (v + crossing[J]) + 0.5
                        ridges[count, SHARPNESS] = crossing[SHARPNESS] / (4 * SUMMED)
                    count += 1
    return count


@compiled
def _measure_range(band: NDArray[np.integer], lowest: NDArray[np.integer], highest: NDArray[np.integer]) -> None:
    """The lowest and the highest value of each column of a band of rows."""
    lowest[:] = band[0]
    highest[:] = band[0]
    for j in range(1, band.shape[0]):
        row = band[j]
        for i in range(row.size):
            lowest[i] = min(lowest[i], row[i])
            highest[i] = max(highest[i], row[i])


@compiled
def _contrast(block: NDArray[np.uint16]) -> int:
    least = most = block[0, 0]
    for v in range(block.shape[0]):
        for u in range(block.shape[1]):
            least, most = min(least, block[v, u]), max(most, block[v, u])
    return int(most) - int(least)


@compiled
def _own_redness(block: NDArray[np.uint16], counts: NDArray[np.int32]) -> int:
    """The redness that a small part of the block's pixels do not exceed."""
    counts[:] = 0
    total = 0
    for v in range(0, block.shape[0], SAMPLED):
        for u in range(0, block.shape[1], SAMPLED):
            counts[block[v, u] % SATURATED] += 1
            total += 1
    wanted = BACKGROUND_PART * total
    level, below = 0, counts[0]
    while below < wanted:
        level += 1
        below += counts[level]
    return level


@compiled
def _cut_out(signal: NDArray[np.uint16], top: int, left: int, patch: NDArray[np.float32]) -> None:
    """The part of the half-size image that begins at (top, left); what lies outside is as its border."""
    rows, columns = signal.shape
    if 0 <= top <= rows - PATCH and 0 <= left <= columns - PATCH:
        for y in range(PATCH):
            for x in range(PATCH):
                patch[y, x] = signal[top + y, left + x]
        return
    for y in range(PATCH):
        for x in range(PATCH):
            patch[y, x] = signal[min(max(top + y, 0), rows - 1), min(max(left + x, 0), columns - 1)]


@compiled
def _smooth(
    patch: NDArray[np.float32], kernel: NDArray[np.float32], along: NDArray[np.float32], smooth: NDArray[np.float32]
) -> None:
    for y in range(PATCH):
        for x in range(SIDE):
            total = np.float32(0)
            for k in range(TAPS):
                total += kernel[k] * patch[y, x + k]
            along[y, x] = total
    for y in range(SIDE):
        for x in range(SIDE):
            total = np.float32(0)
            for k in range(TAPS):
                total += kernel[k] * along[y + k, x]
            smooth[y, x] = total


@compiled
def _mark_summits(smooth: NDArray[np.float32], summits: NDArray[np.uint8]) -> None:
    for y in range(1, SIDE - 1):
        for x in range(1, SIDE - 1):
            here = smooth[y, x]
            down = np.uint8(here >= smooth[y - 1, x]) & np.uint8(here > smooth[y + 1, x])
            across = np.uint8(here >= smooth[y, x - 1]) & np.uint8(here > smooth[y, x + 1])
            summits[y, x] = down * np.uint8(DOWN) + across * np.uint8(ACROSS)


@compiled
def _cross(
    smooth: NDArray[np.float32],
    x: int,
    y: int,
    summit: int,
    least: float,
    crossing: NDArray[np.float64],
) -> bool:
    """Whether a ridge crosses the pixel, which is a `summit` down its column or across its row.

    The offset (i, j) of the crossing, its unit normal and its curvature go into `crossing`.
    """
    here = smooth[y, x]
    d_i = 0.5 * (smooth[y, x + 1] - smooth[y, x - 1])
    d_j = 0.5 * (smooth[y + 1, x] - smooth[y - 1, x])
    d_ii = smooth[y, x + 1] - 2 * here + smooth[y, x - 1]
    d_jj = smooth[y + 1, x] - 2 * here + smooth[y - 1, x]
    d_ij = 0.25 * (smooth[y + 1, x + 1] - smooth[y + 1, x - 1] - smooth[y - 1, x + 1] + smooth[y - 1, x - 1])
    half_difference = 0.5 * (d_ii - d_jj)
    root = math.sqrt(half_difference**2 + d_ij**2)
    curvature = 0.5 * (d_ii + d_jj) - root  # the lower eigenvalue of the Hessian
    if curvature > -least or curvature + 2 * root < ROUND * curvature:
        return False
    # Its eigenvector, from the row of the Hessian that is the longer one.
    if half_difference < 0:
        normal_i, normal_j = root - half_difference, -d_ij
    else:
        normal_i, normal_j = -d_ij, root + half_difference
    length = math.sqrt(normal_i**2 + normal_j**2)
    normal_i /= length
    normal_j /= length
    crossing[I] = crossing[J] = 0.0
    if summit & DOWN and abs(normal_j) >= OBLIQUE * abs(normal_i):
        crossing[J] = -d_j / d_jj
    elif summit & ACROSS and abs(normal_i) >= OBLIQUE * abs(normal_j):
        crossing[I] = -d_i / d_ii
    else:
        return False
    crossing[NORMAL_I], crossing[NORMAL_J], crossing[SHARPNESS] = normal_i, normal_j, -curvature
    return True

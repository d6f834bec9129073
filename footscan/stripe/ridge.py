"""The ridge of the stripe: where the smoothed signal is highest across the stripe, and the normal there.

The red threshold is applied here, to blocks of the image, and in `footscan.stripe.profile`, to the flanks of a profile.

C. Steger, "An unbiased detector of curvilinear structures", IEEE TPAMI 20(2), 1998, doi:10.1109/34.659930. The Hessian
gives the normal; the profile along the normal gives the centre (`footscan.stripe.profile`).
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.loop_parameters import LoopParameters
from footscan.stripe.redness import SATURATED, SIGNAL_SCALE, SUMMED

SIDE = 16
"""Side of a block and its border of one pixel, in px of the half-size image: 16 float32 fill the widest vector
register (512 bit)."""
BLOCK = SIDE - 2
"""Side of the blocks whose background redness a pixel must exceed: wider than a stripe, narrower than a red object."""
RADIUS = 4
"""Half length of the smoothing in px of the half-size image: at least twice its standard deviation."""
PATCH = SIDE + 2 * RADIUS
"""Side of the patch from which a block and its border are smoothed."""
TAPS = 2 * RADIUS + 1
"""Number of weights of the smoothing: a constant, so that the compiler unrolls the loops."""
BACKGROUND_PART = 0.1
"""Quantile of a block's redness that is its background: the widest stripe leaves more of the block uncovered."""
SAMPLED = 2
"""Step in rows and columns of the pixels from which a block's background is taken: a bound of time."""
OBLIQUE = 0.9
"""Ratio of the normal's components from which a ridge is searched for in a direction. Below 1, so that near 45 degrees
rows and columns are both searched and no crossing is lost between them. Chosen by hand."""
ROUND = 0.5
"""Curvature along the ridge, relative to that across, from which it is a spot or the end of a stripe. Chosen by
hand."""
DOWN, ACROSS = 1, 2
"""Flags of a summit: the highest of its neighbours in its column, in its row."""
SPACING_PX = 2
"""Distance of crossings along a stripe that runs along rows or columns: one pixel of the half-size image."""
I, J, NORMAL_I, NORMAL_J, SHARPNESS = range(5)  # noqa: E741 (the name of the axis)
"""Columns of `find_ridges`."""


@lru_cache
def gaussian(sigma: float) -> NDArray[np.float32]:
    """The weights (`TAPS`,) of a Gaussian; `sigma` in px of the half-size image, at most half of `RADIUS`.

    >>> weights = gaussian(1.0)
    >>> print(len(weights), round(float(weights.sum()), 5), bool(weights[4] == weights.max()))
    9 1.0 True
    """
    # The C library's exp: NumPy's differs in its last digits from processor to processor.
    weights = np.array([math.exp(-0.5 * (k / sigma) ** 2) for k in range(-RADIUS, RADIUS + 1)])
    return np.asarray(weights / weights.sum(), np.float32)


@compiled
def find_ridges(
    excess: NDArray[np.uint16],
    signal: NDArray[np.uint16],
    kernel: NDArray[np.float32],
    limits: LoopParameters,
    ridges: NDArray[np.float64],
) -> int:
    """Find the ridge crossings of a frame.

    Ridges are searched for in the half-size image of `halve`, smoothed with `kernel`, since mosaic and JPEG give colour
    for four pixels together. A stripe along the rows is crossed once in two columns of the full-size image, midway
    between them; a stripe along the columns is crossed once in two rows. Searched are the pixels that are redder than
    the background of their block by the red threshold, and those whose red is saturated.

    Parameters
    ----------
    excess, signal : (R, C) uint16, redness and signal of the half-size image.
    kernel : (`TAPS`,) float32, the weights of the smoothing.
    ridges : (capacity, 5) float64, filled with the crossings: i, j (px of the full-size image), the unit normal
        (i, j), and the curvature across (levels of the signal per px^2).

    Returns
    -------
    The number of crossings. Crossings beyond the capacity are counted but not written.
    """
    patch = np.empty((PATCH, PATCH), np.float32)
    along = np.empty((PATCH, SIDE), np.float32)
    smooth = np.empty((SIDE, SIDE), np.float32)
    summits = np.empty((SIDE, SIDE), np.uint8)
    counts = np.empty(SUMMED * 255 + 1, np.int32)
    crossing = np.empty(5)
    threshold, brighter = SUMMED * limits.red_threshold, SUMMED * SIGNAL_SCALE * limits.faintest
    # The second derivative of a parabola of that height and width, in half-size pixels.
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
                        ridges[count, NORMAL_I], ridges[count, NORMAL_J] = crossing[NORMAL_I], crossing[NORMAL_J]
                        ridges[count, I] = 2 * (u + crossing[I]) + 0.5
                        ridges[count, J] = 2 * (v + crossing[J]) + 0.5
                        ridges[count, SHARPNESS] = crossing[SHARPNESS] / (4 * SUMMED)
                    count += 1
    return count


@compiled
def _measure_range(band: NDArray[np.integer], lowest: NDArray[np.integer], highest: NDArray[np.integer]) -> None:
    """Compute the lowest and the highest value of each column of a band of rows."""
    for i in range(band.shape[1]):
        lowest[i] = highest[i] = band[0, i]
    for j in range(1, band.shape[0]):
        row = band[j]
        for i in range(row.size):
            lowest[i] = min(lowest[i], row[i])
            highest[i] = max(highest[i], row[i])


@compiled
def _contrast(block: NDArray[np.uint16]) -> int:
    """The difference of a block's highest and lowest value."""
    least = most = block[0, 0]
    for v in range(block.shape[0]):
        for u in range(block.shape[1]):
            least, most = min(least, block[v, u]), max(most, block[v, u])
    return int(most) - int(least)


@compiled
def _own_redness(block: NDArray[np.uint16], counts: NDArray[np.int32]) -> int:
    """The background redness of a block: the `BACKGROUND_PART` quantile."""
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
    """Copy the part of the half-size image at (top, left) into `patch`; its border pixels continue beyond the image."""
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
    """Smooth a patch along its rows, then along its columns."""
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
    """Mark the pixels inside the border that are the highest `DOWN` their column or `ACROSS` their row."""
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
    """True if a ridge crosses the pixel, whose flags of `_mark_summits` are `summit`.

    Writes the offset (i, j) of the crossing, its unit normal and its curvature into `crossing`.
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
    # Its eigenvector, from the longer row of the Hessian.
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

"""The profile across the stripe: its height, width, symmetry, redness and centre.

A profile is sampled where the normal meets the rows (or the columns, if the stripe runs along the columns). A sample is
then interpolated between pixels of one line only, which does not smear the stripe across itself. A profile begins
midway between two columns. If the stripe runs along the rows, each sample is therefore the mean of both columns.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.centre import WHITE_RISE, are_two, centre_of
from footscan.stripe.loop_parameters import LoopParameters
from footscan.stripe.redness import SIGNAL_SCALE, WHITE_SCALE, light_of, lights_of, red_of, redness_of
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, SHARPNESS, I, J

WIDTH, CONTRAST, SYMMETRY, SATURATION, LIGHT, REDNESS = range(SHARPNESS + 1, SHARPNESS + 7)
"""Columns of the profiles of `measure_profiles`, after those of `find_ridges`."""
COLUMNS = REDNESS + 1
"""Number of columns of a profile."""
VALLEY = 0.3
"""Rise, relative to the fall before it, at which the walk has passed the foot of the stripe. Chosen by hand."""
FLAT, FLAT_SAMPLES = 0.1, 4
"""Fall, relative to that from the top, over so many samples, below which the foot is reached. Chosen by hand."""
RINGING = 0.06
"""Fall, relative to the top, that compression may cause within a saturated stripe; it is no foot. Chosen by hand."""
PART_BITS = 12
PARTS = 1 << PART_BITS
"""Resolution of a sample's place: parts of a pixel. 12 bits keep the interpolation in whole numbers."""
LEVEL_SAMPLES = 8
"""A profile that has not fallen after so many samples is no stripe, unless it is saturated. Chosen by hand."""
EDGE = 0.25
"""Difference of the feet, relative to the height of the stripe, from which an edge runs along it. Chosen by hand."""
NEARLY = 40
"""Grey levels below saturation within which red has no range left to tell a laser from a lamp. Chosen by hand."""
BESIDE = 1.5
"""Samples beyond half height that still count as stripe when redness is compared with the feet. Chosen by hand."""
FOOT_SAMPLES = 4
"""Samples at each foot from which its redness is taken. Chosen by hand."""
NO_LEVEL = 255
"""Redness of a foot that has no samples."""


class Way(NamedTuple):
    """The normal of a stripe in the flattened image. Lines are rows if the stripe runs along rows, else columns."""

    line: int
    pixel: int
    """Distances, in the flattened image, of two lines and of two pixels of one line."""
    at: int
    """The line on which the ridge is."""
    beside: float
    """Where the normal meets that line, px."""
    slope: float
    """By how much that place moves from line to line, px."""
    back: int
    ahead: int
    """How many lines the normal may be followed in either direction."""


class Samples(NamedTuple):
    """Memory for the samples of one profile, (K,) each, with the ridge in the middle."""

    signal: NDArray[np.float64]
    white: NDArray[np.float64]
    cells: NDArray[np.int64]
    """The nearest pixel, in the flattened image."""
    clipped: NDArray[np.bool_]


class Feet(NamedTuple):
    """The feet of a profile: its first and its last sample."""

    first: int
    last: int
    base: float
    """The level of the higher foot."""
    is_even: bool
    """True if both feet are flat, not valleys before other light."""


@compiled
def measure_profiles(
    words: NDArray[np.uint32],
    light: NDArray[np.uint32],
    ridges: NDArray[np.float64],
    limits: LoopParameters,
    profiles: NDArray[np.float64],
) -> int:
    """Measure the profiles across the ridges, and keep those that stand out from both their sides.

    Parameters
    ----------
    words, light : (rows, columns) uint32, the pixels of the frame, and the same less its background, if it has one.
    ridges : (N, 5) float64, the columns of `find_ridges`.
    profiles : (at least N, 11) float64, filled with the columns of `find_ridges`, then width (px), contrast (levels of
        the signal), symmetry and saturation (0 to 1), light of the laser summed over the width (px of a white pixel's
        light), redness (grey levels by which the reddest pixel exceeds the redder foot). Returns how many are filled.
    """
    rows, columns = words.shape
    reach = math.ceil(limits.largest_width)
    size = 2 * reach + 1
    samples = Samples(np.empty(size), np.empty(size), np.empty(size, np.int64), np.empty(size, np.bool_))
    words, light = words.ravel(), light.ravel()
    count = 0
    for n in range(len(ridges)):
        normal_i, normal_j = ridges[n, NORMAL_I], ridges[n, NORMAL_J]
        upright = abs(normal_j) >= abs(normal_i)
        lines, pixels = (rows, columns) if upright else (columns, rows)
        line, pixel = (columns, 1) if upright else (1, columns)
        across, along = (normal_j, normal_i) if upright else (normal_i, normal_j)
        ridge, other = (ridges[n, J], ridges[n, I]) if upright else (ridges[n, I], ridges[n, J])
        slope, step = along / across, 1 / abs(across)
        at = round(ridge)
        beside = other + (at - ridge) * slope
        back, ahead = _steps_inside(at, lines, beside, pixels, slope, reach)
        way = Way(line, pixel, at, beside, slope, back, ahead)
        first, last, base, is_even = _walk(light, way, limits, samples)
        if first == last:
            continue
        feet = Feet(first, last, base, is_even)
        centre = _measure(words, light, samples, feet, step, limits, profiles[count])
        if math.isnan(centre):
            continue
        ridge, other = at + centre - reach, beside + (centre - reach) * slope
        profiles[count, I], profiles[count, J] = (other, ridge) if upright else (ridge, other)
        profiles[count, NORMAL_I], profiles[count, NORMAL_J] = normal_i, normal_j
        profiles[count, SHARPNESS] = ridges[n, SHARPNESS]
        count += 1
    return count


@compiled
def _steps_inside(at: int, lines: int, beside: float, pixels: int, slope: float, reach: int) -> tuple[int, int]:
    """Count the steps back and ahead, at most `reach`, that stay inside the image; -1 if the ridge is outside."""
    if not (0 <= at < lines and 0 <= beside <= pixels - 1):
        return -1, -1
    back, ahead = min(at, reach), min(lines - 1 - at, reach)
    if slope != 0:
        # A hundredth of a pixel inside the border, since `_walk` rounds.
        to_start = int(max(beside - 0.01, 0) / abs(slope))
        to_end = int(max(pixels - 1.01 - beside, 0) / abs(slope))
        back = min(back, to_start if slope > 0 else to_end)
        ahead = min(ahead, to_end if slope > 0 else to_start)
    return back, ahead


@compiled
def _walk(light: NDArray[np.uint32], way: Way, limits: LoopParameters, memory: Samples) -> tuple[int, int, float, bool]:
    """Sample the profile from the ridge to both feet, into `memory`; returns the fields of `Feet`.

    Without a stripe first and last are equal. The laser's light lies above the higher foot, even beside an edge.
    """
    line, pixel, at, beside, slope, back, ahead = way
    samples, white, cells, _ = memory
    middle = samples.size // 2
    if back < 1 or ahead < 1:
        return 0, 0, 0.0, False
    smallest = SIGNAL_SCALE * limits.faintest
    first = last = 0
    is_even = True
    here = base = least_fall = 0.0
    for direction in (-1, 1):
        lowest = math.inf
        end = start = middle if direction < 0 else middle + 1
        # The place on each line in parts of a pixel: whole numbers are several times as fast.
        across = round(beside * PARTS) + (start - middle) * round(slope * PARTS)
        turn = direction * round(slope * PARTS)
        offset = (at + start - middle) * line
        for n in range(start - middle if direction > 0 else 0, (ahead if direction > 0 else back) + 1):
            cell, part = offset + (across >> PART_BITS) * pixel, across & (PARTS - 1)
            lights = lights_of(light[cell]) * (PARTS - part)
            if part > 0:
                lights += lights_of(light[cell + pixel]) * part
            value = (lights & 0xFFFFFFFF) * (1.0 / PARTS)
            end = middle + direction * n
            samples[end] = value
            white[end] = (lights >> 32) * (1.0 / PARTS)
            cells[end] = cell + pixel if 2 * part > PARTS else cell
            if n == 0:
                here = value
                least_fall = max(smallest, RINGING * here)
            lowest = min(lowest, value)
            across += turn
            offset += direction * line
            if n < FLAT_SAMPLES:
                continue
            fall = here - lowest
            if fall >= least_fall:
                if value - lowest > VALLEY * fall:
                    is_even = False
                    break
                if value < here - 0.5 * fall and samples[end - direction * FLAT_SAMPLES] - value < FLAT * fall:
                    break
            elif n >= LEVEL_SAMPLES and fall < smallest and here < SIGNAL_SCALE * limits.saturation:
                break
        if here - lowest < smallest:
            return 0, 0, 0.0, False
        base = max(base, lowest)
        first, last = (end, last) if direction < 0 else (first, end)
    return first, last, base, is_even


@compiled
def _measure(
    words: NDArray[np.uint32],
    light: NDArray[np.uint32],
    memory: Samples,
    feet: Feet,
    step: float,
    limits: LoopParameters,
    profile: NDArray[np.float64],
) -> float:
    """Measure one profile into `profile` (11,); returns its centre in samples, NaN if it is no stripe."""
    samples, white, cells, clipped = memory
    first, last, base, is_even = feet
    middle = samples.size // 2
    if is_even:
        base = _level(samples, first, middle, last, base)
    here = samples[middle]
    left, right, top = _half_height(samples, middle, base + 0.5 * (here - base), first, last)
    contrast = top - base
    if contrast < 2 * (here - base):  # otherwise the ridge is on a shoulder
        left, right, top = _half_height(samples, middle, base + 0.5 * contrast, first, last)
    width = (right - left) * step
    if left < 0 or width > limits.largest_width:
        return math.nan
    saturation = _saturation(words, cells, clipped, first, last, left, right, limits)
    redness, is_laser = _redness(words, light, cells, saturation, first, last, left, right, limits)
    if not is_laser:
        return math.nan
    centre = math.nan
    if saturation > 0:
        if are_two(white, *_stripe_samples(first, last, left, right)):
            return math.nan
        centre = _white_centre(white, clipped, first, last, left, right, is_even, limits)
    if math.isnan(centre):
        centre = centre_of(samples, clipped, first, last, left, right, base, contrast, limits)
    if not abs(centre - middle) * step <= 1 + 0.5 * width:
        return math.nan
    profile[WIDTH], profile[CONTRAST] = width, contrast
    profile[SATURATION], profile[REDNESS] = saturation, redness
    foot = max(light_of(words[cells[first]]), light_of(words[cells[last]]))
    profile[LIGHT] = max(light_of(words[cells[middle]]) - foot, 0.0) * width
    profile[SYMMETRY] = max(0.0, 1 - abs((right - centre) - (centre - left)) / (right - left))
    return centre


@compiled
def _level(samples: NDArray[np.float64], first: int, top: int, last: int, base: float) -> float:
    """Subtract the slope of the room's light from the samples; returns the level of the feet afterwards.

    In a room darker than the stripe the samples remain: a slope is then an edge, or light of another stripe.
    """
    rise, height = samples[last] - samples[first], samples[top] - base
    if base < height or abs(rise) >= EDGE * height:
        return base
    slope = rise / (last - first)
    for k in range(first, last + 1):
        samples[k] -= slope * (k - top)
    return max(_lowest(samples, first, top), _lowest(samples, top, last))


@compiled
def _white_centre(
    white: NDArray[np.float64],
    clipped: NDArray[np.bool_],
    first: int,
    last: int,
    left: float,
    right: float,
    is_even: bool,
    limits: LoopParameters,
) -> float:
    """Centre of the white core of a stripe whose red is saturated from `left` to `right`; NaN if there is no core.

    Light scattered by skin and lens saturates red around the core, farther on one side than on the other.
    """
    top = max(math.ceil(left), first)
    for k in range(top + 1, min(math.floor(right), last) + 1):
        if white[k] > white[top]:
            top = k
    base = max(_lowest(white, first, top), _lowest(white, top, last))
    if is_even:
        base = _level(white, first, top, last, base)
    rim = max(white[max(math.floor(left), first)], white[min(math.ceil(right), last)], white[first], white[last])
    contrast = white[top] - base
    if white[top] - rim < WHITE_RISE:
        return math.nan
    left, right, _ = _half_height(white, top, base + 0.5 * contrast, first, last)
    if left < 0:
        return math.nan
    for k in range(first, last + 1):
        clipped[k] = white[k] >= WHITE_SCALE * limits.saturation
    return centre_of(white, clipped, first, last, left, right, base, contrast, limits)


@compiled
def _lowest(samples: NDArray[np.float64], first: int, last: int) -> float:
    """The lowest of the samples from `first` to `last`, both included."""
    lowest: float = samples[first]
    for k in range(first + 1, last + 1):
        lowest = min(lowest, samples[k])
    return lowest


@compiled
def _half_height(
    samples: NDArray[np.float64], middle: int, level: float, first: int, last: int
) -> tuple[float, float, float]:
    """Find where the profile falls to `level` on both sides, in samples, -1 if it does not; and the top between."""
    left, right = middle, middle
    top = samples[middle]
    while left > first and samples[left] > level:
        left -= 1
        top = max(top, samples[left])
    while right < last and samples[right] > level:
        right += 1
        top = max(top, samples[right])
    if samples[left] > level or samples[right] > level or left == right:
        return -1.0, -1.0, top
    return (
        left + (level - samples[left]) / (samples[left + 1] - samples[left]),
        right - (level - samples[right]) / (samples[right - 1] - samples[right]),
        top,
    )


@compiled
def _saturation(
    words: NDArray[np.uint32],
    cells: NDArray[np.int64],
    clipped: NDArray[np.bool_],
    first: int,
    last: int,
    left: float,
    right: float,
    limits: LoopParameters,
) -> float:
    """The part of the stripe's width in which red is saturated; marks the saturated samples in `clipped`."""
    saturated = inside = 0
    for k in range(*_stripe_samples(first, last, left, right)):
        clipped[k] = red_of(words[cells[k]]) >= limits.saturation
        if left <= k <= right:
            inside += 1
            saturated += clipped[k]
    return saturated / max(inside, 1)


@compiled
def _redness(
    words: NDArray[np.uint32],
    light: NDArray[np.uint32],
    cells: NDArray[np.int64],
    saturation: float,
    first: int,
    last: int,
    left: float,
    right: float,
    limits: LoopParameters,
) -> tuple[int, bool]:
    """By how much the reddest pixel of the stripe exceeds the redder foot; and True if its light may be a laser's.

    The laser's light is redder than its surroundings, at least in the flanks, but for a foot that is nearly saturated.
    """
    reddest = 0
    for k in range(*_stripe_samples(first, last, left, right)):
        reddest = max(reddest, redness_of(light[cells[k]]))
    if saturation > 0.5:  # the flanks are whitish, and the halo around them is the reddest part
        for k in range(first + FOOT_SAMPLES, last - FOOT_SAMPLES + 1):
            reddest = max(reddest, redness_of(light[cells[k]]))
    least, is_laser = reddest, True
    for end, direction in ((first, 1), (last, -1)):
        redness, level = NO_LEVEL, 0
        for n in range(FOOT_SAMPLES):
            k = end + direction * n
            if left - BESIDE <= k <= right + BESIDE:
                break
            redness = min(redness, redness_of(light[cells[k]]))
            level = max(level, red_of(words[cells[k]]))
        if redness == NO_LEVEL:
            continue
        least = min(least, reddest - redness)
        is_foot_saturated = saturation > 0.5 and level >= limits.saturation - NEARLY
        if reddest - redness < limits.red_threshold and not is_foot_saturated:
            is_laser = False
    return least, is_laser


@compiled
def _stripe_samples(first: int, last: int, left: float, right: float) -> tuple[int, int]:
    """The range of samples that belong to the stripe, as arguments of `range`."""
    return max(first, math.ceil(left - BESIDE)), min(last, math.floor(right + BESIDE)) + 1

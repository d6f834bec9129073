"""The profile across the stripe: what stands out of it, how wide, how even, and where its centre is.

A profile is sampled where the normal meets the rows (or the columns, where the stripe runs along these): there it lies
between pixels of one line alone, and the stripe is not smeared across itself. It begins midway between two columns, and
so is the mean of both where the stripe runs along the rows.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.centre import centre_of
from footscan.stripe.limits import Limits
from footscan.stripe.redness import SIGNAL_SCALE, WHITE_SCALE, light_of, lights_of, red_of, redness_of
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, SHARPNESS, I, J

WIDTH, CONTRAST, SYMMETRY, SATURATION, LIGHT, REDNESS = range(SHARPNESS + 1, SHARPNESS + 7)
"""Columns of what `measure_profiles` writes, after those of the ridge."""
COLUMNS = REDNESS + 1
VALLEY = 0.3
"""Rise, relative to the fall before it, at which the foot of the stripe is passed."""
FLAT = 0.1
"""Fall over `FLAT_SAMPLES`, relative to that from the top, that is the foot of the stripe."""
FLAT_SAMPLES = 4
RINGING = 0.06
"""What compression makes of a saturated level is less than this part of it, and no foot."""
PART_BITS = 12
PARTS = 1 << PART_BITS
"""Of a pixel, to which the place of a sample is known."""
LEVEL_SAMPLES = 8
"""What has not fallen after so many samples is no stripe, unless it is saturated."""
EDGE = 0.25
"""Difference of the feet, relative to the height of the stripe, from which an edge runs along it."""
NEARLY = 40
"""Levels below saturation at which red has no room left to tell a laser from a lamp."""
WHITE_RISE = 60.0
"""Levels of R + 3 G + B by which a core must be whiter than its rim, and than what lies beside it, to count."""
BESIDE = 1.5
"""Samples beyond half height that still belong to the stripe when its redness is held against that beside it."""
FOOT_SAMPLES = 4
"""So many samples at the foot tell how red it is."""


class Way(NamedTuple):
    """The normal of a stripe through the pixels of a picture (rows * columns,), line by line."""

    line: int
    pixel: int
    """How far apart, in the picture, two lines are and two pixels of one."""
    at: int
    """The line on which the ridge is."""
    beside: float
    """Where the normal meets that line, px."""
    slope: float
    """How far that moves on from line to line, px."""
    back: int
    ahead: int
    """How many lines it may be followed."""


class Samples(NamedTuple):
    """Memory for the samples of one profile, the ridge in the middle of it."""

    signal: NDArray[np.float64]
    white: NDArray[np.float64]
    cells: NDArray[np.int64]
    """The pixel nearest to each."""
    clipped: NDArray[np.bool_]


class Feet(NamedTuple):
    """Where a profile begins and ends."""

    first: int
    last: int
    base: float
    """The level of the higher foot."""
    is_even: bool
    """Whether both feet are even."""


@compiled
def measure_profiles(
    words: NDArray[np.uint32],
    light: NDArray[np.uint32],
    ridges: NDArray[np.float64],
    limits: Limits,
    profiles: NDArray[np.float64],
) -> int:
    """Writes what stands out from both its sides, of `ridges` (N, 5), into `profiles` (N, 11); how many these are.

    `words` are the frame's pixels, (rows, columns), and `light` the same without what the room lights, if known.
    Contrasts are in levels of the signal; i, j and widths in px; the laser's light, summed over the width, in px of the
    light that a white pixel has; redness in grey levels, the reddest of the stripe over the redder of its feet.
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
        # Lines are the rows where the stripe runs along these, otherwise the columns.
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
        centre = _measure(words, light, samples, feet, step, limits, profiles, count)
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
    """How many steps back and ahead, at most `reach`, stay inside the image; -1 where the ridge itself is outside."""
    if not (0 <= at < lines and 0 <= beside <= pixels - 1):
        return -1, -1
    back, ahead = min(at, reach), min(lines - 1 - at, reach)
    if slope != 0:
        # A hundredth of a pixel short of the border, for `_walk` rounds.
        to_start = int(max(beside - 0.01, 0) / abs(slope))
        to_end = int(max(pixels - 1.01 - beside, 0) / abs(slope))
        back = min(back, to_start if slope > 0 else to_end)
        ahead = min(ahead, to_end if slope > 0 else to_start)
    return back, ahead


@compiled
def _walk(light: NDArray[np.uint32], way: Way, limits: Limits, memory: Samples) -> tuple[int, int, float, bool]:
    """Samples outward from the ridge to both feet of the stripe; the first and the last one, equal where there is none.

    And the level of the higher foot: what lies above it is the laser's, whatever edge runs beside the stripe; and
    whether both feet are even, not valleys before other light.
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
        # Where the normal meets each line, in parts of a pixel: whole numbers are several times as fast.
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
    limits: Limits,
    profiles: NDArray[np.float64],
    n: int,
) -> float:
    """The centre in samples; NaN where it is no stripe. What the profile is like goes into row `n` of `profiles`."""
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
        centre = _white_centre(white, clipped, first, last, left, right, is_even, limits)
    if math.isnan(centre):
        centre = centre_of(samples, clipped, first, last, left, right, base, contrast, limits)
    if not abs(centre - middle) * step <= 1 + 0.5 * width:
        return math.nan
    profiles[n, WIDTH], profiles[n, CONTRAST] = width, contrast
    profiles[n, SATURATION], profiles[n, REDNESS] = saturation, redness
    foot = max(light_of(words[cells[first]]), light_of(words[cells[last]]))
    profiles[n, LIGHT] = max(light_of(words[cells[middle]]) - foot, 0.0) * width
    profiles[n, SYMMETRY] = max(0.0, 1 - abs((right - centre) - (centre - left)) / (right - left))
    return centre


@compiled
def _level(samples: NDArray[np.float64], first: int, top: int, last: int, base: float) -> float:
    """Takes the slope of the room's light out of the samples; the level of the feet then.

    Where the room is darker than the stripe it is left alone: a slope is an edge there, or light of another stripe.
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
    limits: Limits,
) -> float:
    """The centre of the white core of a stripe whose red is saturated from `left` to `right`; NaN where it has none.

    Around the core the light that skin and lens scatter saturates red as well, more on one side than on the other.
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
    lowest: float = samples[first]
    for k in range(first + 1, last + 1):
        lowest = min(lowest, samples[k])
    return lowest


@compiled
def _half_height(
    samples: NDArray[np.float64], middle: int, level: float, first: int, last: int
) -> tuple[float, float, float]:
    """Where the profile falls to the level on either side, in samples, -1 where it does not; the highest between."""
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
    limits: Limits,
) -> float:
    """The part of the stripe's width in which red is saturated; fills `clipped` with where it is."""
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
    limits: Limits,
) -> tuple[int, bool]:
    """By how much the reddest of the stripe is redder than the redder one of its feet; whether its light is a laser's.

    The laser's light is redder than what lies beside it, in the flanks at least. On a side where red has no room left
    above it, any light may be the laser's.
    """
    reddest = 0
    for k in range(*_stripe_samples(first, last, left, right)):
        reddest = max(reddest, redness_of(light[cells[k]]))
    if saturation > 0.5:  # the flanks are whitish, and reddest is the halo around them
        for k in range(first + FOOT_SAMPLES, last - FOOT_SAMPLES + 1):
            reddest = max(reddest, redness_of(light[cells[k]]))
    least, is_laser = reddest, True
    for end, direction in ((first, 1), (last, -1)):
        redness, level = 255, 0
        for n in range(FOOT_SAMPLES):
            k = end + direction * n
            if left - BESIDE <= k <= right + BESIDE:
                break
            redness = min(redness, redness_of(light[cells[k]]))
            level = max(level, red_of(words[cells[k]]))
        if redness == 255:
            continue
        least = min(least, reddest - redness)
        has_no_room = saturation > 0.5 and level >= limits.saturation - NEARLY
        if reddest - redness < limits.red_threshold and not has_no_room:
            is_laser = False
    return least, is_laser


@compiled
def _stripe_samples(first: int, last: int, left: float, right: float) -> tuple[int, int]:
    """From which sample on, and before which, a profile is the stripe's."""
    return max(first, math.ceil(left - BESIDE)), min(last, math.floor(right + BESIDE)) + 1

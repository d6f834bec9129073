"""The profile across the stripe: its sub-pixel centre, width, height and symmetry."""

import math

import numba
import numpy as np
from numpy.typing import NDArray

STEP = 0.5
"""Distance in px of the samples across the stripe."""
ALONG = 2.0
"""Half length in px over which the profile is averaged along the stripe, against speckle."""
OUTWARD = 2.0
"""Distance in px of the samples that the level beside the stripe is taken from."""
CENTRE_I, CENTRE_J, NORMAL_I, NORMAL_J, CURVATURE, WIDTH, CONTRAST, SYMMETRY = range(8)
"""Columns of what `measure_profiles` writes."""


@numba.njit(cache=True, nogil=True)
def measure_profiles(
    signal: NDArray[np.uint16],
    excess: NDArray[np.uint8],
    ridges: NDArray[np.float64],
    limits: tuple[float, float, float, float],
    profiles: NDArray[np.float64],
) -> int:
    """Writes what stands out from both its sides, of `ridges` (N, 5), into `profiles` (N, 8); how many these are.

    `limits` are the largest width in px, the smallest contrast in levels of the signal, the smallest contrast in grey
    levels of `excess`, and the part of the height above which the centre of gravity is taken.
    """
    samples = np.empty(2 * math.ceil(limits[0] / STEP) + 1)
    count = 0
    for ridge in ridges:
        profile = profiles[count]
        profile[: ridge.size] = ridge
        if _measure(signal, excess, limits, samples, profile):
            count += 1
    return count


@numba.njit(cache=True, nogil=True)
def _measure(
    signal: NDArray[np.uint16],
    excess: NDArray[np.uint8],
    limits: tuple[float, float, float, float],
    samples: NDArray[np.float64],
    profile: NDArray[np.float64],
) -> bool:
    """Moves the centre to the centre of gravity of what stands out, and measures it; False where nothing does."""
    largest_width, smallest_contrast, smallest_redness, centre_level = limits
    middle = samples.size // 2
    here = _average(signal, profile, 0.0)
    # The higher of the two sides: what lies above it is the laser's, whatever edge runs beside the stripe.
    base = max(_lowest(signal, profile, -OUTWARD, largest_width), _lowest(signal, profile, OUTWARD, largest_width))
    if not here - base >= smallest_contrast:
        return False
    floor = base + min(centre_level, 0.5) * (here - base)
    first = _fall(signal, profile, floor, -1, samples)
    last = _fall(signal, profile, floor, 1, samples)
    if first < 0 or last >= samples.size:
        return False
    samples[middle] = here
    top = first + int(np.argmax(samples[first : last + 1]))
    contrast = samples[top] - base
    half = base + 0.5 * contrast
    left, right = _reach(samples, top, -1, half), _reach(samples, top, 1, half)
    width = (left + right) * STEP
    if width > largest_width:
        return False
    level = base + centre_level * contrast
    first, last = top - int(_reach(samples, top, -1, level)), top + int(_reach(samples, top, 1, level))
    weight = moment = reddest = 0.0
    for n in range(first, last + 1):
        weight += samples[n] - level
        moment += (samples[n] - level) * (n - top)
        t = (n - middle) * STEP
        reddest = max(
            reddest,
            _sample(excess, profile[CENTRE_I] + t * profile[NORMAL_I], profile[CENTRE_J] + t * profile[NORMAL_J]),
        )
    own_red = max(_lowest(excess, profile, -OUTWARD, largest_width), _lowest(excess, profile, OUTWARD, largest_width))
    if reddest - own_red < smallest_redness:
        return False
    centre = moment / weight  # in samples from the top
    shift = STEP * (top - middle + centre)
    profile[CENTRE_I] += shift * profile[NORMAL_I]
    profile[CENTRE_J] += shift * profile[NORMAL_J]
    profile[WIDTH] = width
    profile[CONTRAST] = contrast
    profile[SYMMETRY] = max(0.0, 1 - abs((right - centre) - (left + centre)) / (left + right))
    return bool(abs(shift) <= 1 + 0.5 * width)


@numba.njit(cache=True, nogil=True)
def _lowest(signal: NDArray[np.integer], profile: NDArray[np.float64], step: float, reach: float) -> float:
    """The lowest level on one side of the ridge; infinite where that side lies outside the image."""
    lowest: float = math.inf
    for n in range(1, int(reach / abs(step)) + 1):
        value = _sample(
            signal,
            profile[CENTRE_I] + n * step * profile[NORMAL_I],
            profile[CENTRE_J] + n * step * profile[NORMAL_J],
        )
        if math.isnan(value):
            break
        lowest = min(lowest, value)
    return lowest


@numba.njit(cache=True, nogil=True)
def _fall(
    signal: NDArray[np.uint16],
    profile: NDArray[np.float64],
    floor: float,
    direction: int,
    samples: NDArray[np.float64],
) -> int:
    """Samples outward from the ridge until the profile falls to `floor`; the index of that sample, or one outside."""
    n = samples.size // 2 + direction
    while 0 <= n < samples.size:
        samples[n] = _average(signal, profile, (n - samples.size // 2) * STEP)
        if samples[n] <= floor:
            return n
        if math.isnan(samples[n]):
            break
        n += direction
    return -1 if direction < 0 else samples.size


@numba.njit(cache=True, nogil=True)
def _average(signal: NDArray[np.uint16], profile: NDArray[np.float64], t: float) -> float:
    """The signal at distance `t` across the ridge, averaged along it; not a number outside the image."""
    i, j = profile[CENTRE_I] + t * profile[NORMAL_I], profile[CENTRE_J] + t * profile[NORMAL_J]
    along_i, along_j = -ALONG * profile[NORMAL_J], ALONG * profile[NORMAL_I]
    here: float = _sample(signal, i, j)
    before: float = _sample(signal, i - along_i, j - along_j)
    after: float = _sample(signal, i + along_i, j + along_j)
    # At the border of the image the average must stay symmetric.
    return here if math.isnan(before) or math.isnan(after) else 0.5 * here + 0.25 * (before + after)


@numba.njit(cache=True, nogil=True)
def _sample(signal: NDArray[np.integer], i: float, j: float) -> float:
    """The level between pixels, bilinear; not a number outside the image."""
    rows, columns = signal.shape
    if not (0 <= i <= columns - 1 and 0 <= j <= rows - 1):
        return math.nan
    i0, j0 = min(int(i), max(columns - 2, 0)), min(int(j), max(rows - 2, 0))
    i1, j1 = min(i0 + 1, columns - 1), min(j0 + 1, rows - 1)
    u, v = i - i0, j - j0
    upper = (1 - u) * signal[j0, i0] + u * signal[j0, i1]
    lower = (1 - u) * signal[j1, i0] + u * signal[j1, i1]
    return float((1 - v) * upper + v * lower)


@numba.njit(cache=True, nogil=True)
def _reach(samples: NDArray[np.float64], top: int, direction: int, level: float) -> float:
    """How many samples from the top, with a fraction, the profile falls to `level`."""
    n = top
    while samples[n] > level:
        n += direction
    return abs(n - top) - float((level - samples[n]) / (samples[n - direction] - samples[n]))

"""The centre of one profile, to a fraction of a sample, by the method that the parameters name.

threshold-median : the median of the samples above half height, as in the thesis
gravity : the centre of gravity of the part of the profile above a level
gaussian : a Gaussian fitted to the samples that are not saturated, as a parabola through their logarithms; `gravity`
    where too few samples are left (H. Guo, "A simple algorithm for fitting a Gaussian function", IEEE Signal
    Processing Magazine 28(5), 2011, doi:10.1109/MSP.2011.941846)
ridge : where the first derivative of the profile, smoothed by a Gaussian as wide as the stripe, is zero (Steger 1998)
fir : the zero crossing of a difference of two boxes, each as long as the stripe is wide (F. Blais and M. Rioux,
    "Real-time numerical peak detector", Signal Processing 11(2), 1986, doi:10.1016/0165-1684(86)90033-2)
"""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.loop_parameters import FIR, GAUSSIAN, GRAVITY, RIDGE, LoopParameters

SCALE = 0.5
"""Standard deviation of the smoothing of `ridge`, in widths of the stripe: 1.18 times that of a Gaussian profile, so
that it reaches the flanks of a saturated stripe. Steger (1998) requires 0.29 at least. Chosen by hand."""
CUT = 2.6
"""Half length of the smoothing window of `ridge`, in its standard deviations. Chosen by hand."""
PASSES = 3
"""Newton steps of `ridge` at most: a bound of time."""
SMALLEST_MOVE = 1e-3
"""Newton step of `ridge`, in samples, below which the iteration ends."""
CAP = 0.9
"""Part of the height of a saturated stripe above which `gravity` ignores the profile: its top is cut off, and may be
skewed by that. Chosen by hand."""
LEAST, BEYOND, FEWEST = 0.2, 1.5, 4
"""Samples that the fit of a Gaussian uses: their least height, relative to the stripe; how far beyond half height they
may lie, in samples; how few are enough. A parabola needs three; the rest is chosen by hand."""
SINGULAR = 1e-9
"""Determinant of the normal equations of that fit, relative to the product of their diagonal, that counts as zero."""
FIR_REACH = 2
"""How far from the middle of the stripe `fir` searches for a zero crossing, in samples. Chosen by hand."""
WHITE_RISE = 60.0
"""Levels of R + 3 G + B (12 grey levels) by which a white core exceeds rim and feet at least. Chosen by hand."""
BETWEEN = 0.15
"""Depth of the valley between two stripes, relative to the lower one, from which they count as two. Chosen by hand."""
VALLEY = 70.0
"""Least depth of the valley, in levels of R + 3 G + B. Tuned on a photograph by day, in which noise makes valleys of 60
levels in 4 % of the lines, of 70 in 0.5 %."""
LEAST_PEAK = 0.3
"""Height of the lower one, relative to the other. Chosen by hand."""


@compiled
def centre_of(
    samples: NDArray[np.float64],
    clipped: NDArray[np.bool_],
    first: int,
    last: int,
    left: float,
    right: float,
    base: float,
    contrast: float,
    limits: LoopParameters,
) -> float:
    """Find the centre of a profile.

    Parameters
    ----------
    samples : (K,) float64, levels across the stripe; those from `first` to `last` (included) are valid.
    clipped : (K,) bool, True for saturated samples; valid between `left` and `right` and a little beyond.
    left, right : where the profile falls to half height, in samples.
    base : level beside the stripe, on the side where it is higher.
    contrast : height of the profile above `base`.

    Returns
    -------
    The centre in samples from the first of `samples`; NaN if the method finds none.

    Examples
    --------
    >>> from schemas.parameters.extraction import ExtractionParameters
    >>> from footscan.stripe.loop_parameters import loop_parameters_of
    >>> samples = np.array([0.0, 0.0, 10.0, 20.0, 10.0, 0.0, 0.0])
    >>> clipped = np.zeros(7, np.bool_)
    >>> limits = loop_parameters_of(ExtractionParameters(centre_method="gravity"))
    >>> print(round(centre_of(samples, clipped, 0, 6, 2.0, 4.0, 0.0, 20.0, limits), 6))
    3.0
    """
    if limits.method == GAUSSIAN:
        fitted = _gaussian(samples, clipped, first, last, left, right, base, contrast)
        if not math.isnan(fitted):
            return fitted
    if limits.method in (GRAVITY, GAUSSIAN):
        return _gravity(samples, clipped, first, last, left, right, base, contrast, limits.centre_level)
    if limits.method == RIDGE:
        return _ridge(samples, first, last, left, right)
    if limits.method == FIR:
        return _fir(samples, first, last, left, right)
    return 0.5 * (math.ceil(left) + math.floor(right))


@compiled
def _gravity(
    samples: NDArray[np.float64],
    clipped: NDArray[np.bool_],
    first: int,
    last: int,
    left: float,
    right: float,
    base: float,
    contrast: float,
    level: float,
) -> float:
    """Centre of gravity of the profile above a level; of its flanks alone, below `CAP`, where it is saturated."""
    a, b = math.floor(left), math.ceil(right)
    while a > first and samples[a] > base + level * contrast:
        a -= 1
    while b < last and samples[b] > base + level * contrast:
        b += 1
    origin = 0.5 * (left + right)
    area, moment = _above(samples, a, b, base + level * contrast, origin)
    if clipped[round(origin)] and level < CAP:
        cut_area, cut_moment = _above(samples, a, b, base + CAP * contrast, origin)
        area, moment = area - cut_area, moment - cut_moment
    return origin + moment / area if area > 0 else math.nan


@compiled
def _above(samples: NDArray[np.float64], a: int, b: int, level: float, origin: float) -> tuple[float, float]:
    """Exact area of the polygon through samples `a` to `b` above a level, and its first moment about `origin`."""
    area = moment = 0.0
    for k in range(a, b):
        low, high = samples[k] - level, samples[k + 1] - level
        start, end = 0.0, 1.0
        if low < 0 and high < 0:
            continue
        if low < 0:
            start = low / (low - high)
            low = 0.0
        elif high < 0:
            end = low / (low - high)
            high = 0.0
        length = end - start
        part = 0.5 * length * (low + high)
        area += part
        # The centroid of a trapezoid lies off the middle of its base in proportion to the difference of its sides.
        moment += part * (k + 0.5 * (start + end) - origin) + length * length * (high - low) / 12
    return area, moment


@compiled
def _gaussian(
    samples: NDArray[np.float64],
    clipped: NDArray[np.bool_],
    first: int,
    last: int,
    left: float,
    right: float,
    base: float,
    contrast: float,
) -> float:
    """Centre of the fitted Gaussian; NaN if fewer than `FEWEST` samples are left or the parabola has no maximum."""
    reach = 0.5 * (right - left)
    count = 0
    origin = 0.5 * (left + right)
    s0 = s1 = s2 = s3 = s4 = t0 = t1 = t2 = 0.0
    for k in range(max(first, math.ceil(left - BEYOND)), min(last, math.floor(right + BEYOND)) + 1):
        height = samples[k] - base
        if height <= LEAST * contrast or clipped[k]:
            continue
        count += 1
        x = (k - origin) / reach
        weight = height * height
        log = math.log(height)
        s0 += weight
        s1 += weight * x
        s2 += weight * x * x
        s3 += weight * x**3
        s4 += weight * x**4
        t0 += weight * log
        t1 += weight * x * log
        t2 += weight * x * x * log
    determinant = s0 * (s2 * s4 - s3 * s3) - s1 * (s1 * s4 - s2 * s3) + s2 * (s1 * s3 - s2 * s2)
    if count < FEWEST or not abs(determinant) > SINGULAR * s0 * s2 * s4:
        return math.nan
    linear = (s0 * (t1 * s4 - s3 * t2) - t0 * (s1 * s4 - s2 * s3) + s2 * (s1 * t2 - s2 * t1)) / determinant
    square = (s0 * (s2 * t2 - s3 * t1) - s1 * (s1 * t2 - s2 * t1) + t0 * (s1 * s3 - s2 * s2)) / determinant
    return origin - reach * 0.5 * linear / square if square < 0 else math.nan


@compiled
def _ridge(samples: NDArray[np.float64], first: int, last: int, left: float, right: float) -> float:
    """Zero of the smoothed profile's first derivative, by Newton's method from the middle; NaN if there is none."""
    sigma = SCALE * (right - left)
    centre = 0.5 * (left + right)
    for _ in range(PASSES):
        reach = min(CUT * sigma, centre - first, last - centre)
        # The window and its slope fall to zero at its ends: with a truncated Gaussian the centre would jump from
        # sample to sample.
        ratio = 1 / (reach * reach)
        first_derivative = second_derivative = 0.0
        for k in range(math.ceil(centre - reach), math.floor(centre + reach) + 1):
            t = k - centre
            u = 1 - t * t * ratio
            first_derivative += samples[k] * t * u * u
            second_derivative += samples[k] * u * (u - 4 * t * t * ratio)
        if not second_derivative > 0:
            return math.nan
        move = first_derivative / second_derivative
        centre += move
        if not first + 1 < centre < last - 1:
            return math.nan
        if abs(move) < SMALLEST_MOVE:
            break
    return centre


@compiled
def _fir(samples: NDArray[np.float64], first: int, last: int, left: float, right: float) -> float:
    """Zero crossing of the filtered profile that is nearest to the middle of the stripe; NaN if there is none."""
    order = max(2, math.ceil(right - left))
    middle = round(0.5 * (left + right))
    order = min(order, middle - first - 1, last - middle - 1)
    best = math.nan
    for k in range(middle - FIR_REACH, middle + FIR_REACH):
        if k - order + 1 < first or k + 1 + order > last:
            continue
        before = _boxes(samples, k, order)
        after = _boxes(samples, k + 1, order)
        if before <= 0 < after:
            crossing = k - before / (after - before)
            if math.isnan(best) or abs(crossing - middle) < abs(best - middle):
                best = crossing
    return best


@compiled
def _boxes(samples: NDArray[np.float64], k: int, order: int) -> float:
    """Sum of the `order` samples before sample `k`, minus that of the `order` samples after it."""
    total = 0.0
    for n in range(1, order + 1):
        total += samples[k - n] - samples[k + n]
    return total


@compiled
def are_two(light: NDArray[np.float64], start: int, stop: int) -> bool:
    """True if the light has two peaks and a valley between them, which red that is saturated does not show.

    Where the lasers of two heads are a millimetre apart, their stripes touch, and what lies between is neither. Speckle
    in the broad spot of a sheet that grazes a heel makes shallower valleys.
    """
    top = start + np.argmax(light[start:stop])
    base = min(light[start], light[stop - 1])
    least = base + LEAST_PEAK * (light[top] - base)
    for direction, end in ((-1, start - 1), (1, stop)):
        lowest = light[top]
        for k in range(top, end, direction):
            lowest = min(lowest, light[k])
            if light[k] > least and light[k] - lowest > max(BETWEEN * (light[k] - base), VALLEY):
                return True
    return False

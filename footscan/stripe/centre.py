"""The centre of one profile, to a fraction of a sample, by the method that the parameters name.

threshold-median : the median of the samples above half height, as in the thesis
gravity : the centre of gravity of what lies above a level
gaussian : the Gaussian through the samples that are not saturated, their logarithms a parabola; where too few are
    left, as `gravity` (H. Guo, "A simple algorithm for fitting a Gaussian function", IEEE Signal Processing Magazine
    28(5), 2011, doi:10.1109/MSP.2011.941846)
ridge : where the first derivative of the profile, smoothed by a Gaussian as wide as the stripe, is zero (Steger 1998)
fir : the zero crossing of a difference of two boxes, each as long as the stripe is wide (F. Blais and M. Rioux,
    "Real-time numerical peak detector", Signal Processing 11(2), 1986, doi:10.1016/0165-1684(86)90033-2)
"""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.limits import FIR, GAUSSIAN, GRAVITY, RIDGE, Limits

SCALE = 0.5
"""Standard deviation of the smoothing of `ridge`, in widths of the stripe: 1.18 times that of a Gaussian profile, and
where the flanks of a saturated one are. Steger asks for 0.29 at least."""
CUT = 2.6
"""Where the smoothing of `ridge` ends, in its standard deviations."""
PASSES = 3
CAP = 0.9
"""Of the height of a saturated stripe, what `gravity` counts no more: its top is cut off, and may be so askew."""
LEAST, BEYOND, FEWEST = 0.2, 1.5, 4
"""Of the fit of a Gaussian: what it counts of the height, how many samples beyond half height, and how few will do."""


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
    limits: Limits,
) -> float:
    """The centre in samples; not a number where the method finds none.

    Parameters
    ----------
    samples : levels across the stripe, of which those from `first` to `last` are there.
    left, right : where the profile falls to half height.
    clipped : which samples around these are saturated.
    base : the level beside the stripe, on the side where it is higher.
    contrast : height of the profile above it.
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
    """Of what lies above a level around the stripe; where it is saturated, also below another: of its flanks."""
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
    """Area above a level of the polygon through samples a to b, and its first moment around `origin`, exactly."""
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
        # Of a trapezoid: the middle of its base, and off it by the difference of its sides.
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
    """Not a number where fewer than `FEWEST` samples are left, or where they are no Gaussian."""
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
    if count < FEWEST or not abs(determinant) > 1e-9 * s0 * s2 * s4:
        return math.nan
    linear = (s0 * (t1 * s4 - s3 * t2) - t0 * (s1 * s4 - s2 * s3) + s2 * (s1 * t2 - s2 * t1)) / determinant
    square = (s0 * (s2 * t2 - s3 * t1) - s1 * (s1 * t2 - s2 * t1) + t0 * (s1 * s3 - s2 * s2)) / determinant
    return origin - reach * 0.5 * linear / square if square < 0 else math.nan


@compiled
def _ridge(samples: NDArray[np.float64], first: int, last: int, left: float, right: float) -> float:
    sigma = SCALE * (right - left)
    centre = 0.5 * (left + right)
    for _ in range(PASSES):
        reach = min(CUT * sigma, centre - first, last - centre)
        # The window falls to zero at its ends with its slope: a Gaussian cut off hard would jump from sample to sample.
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
        if abs(move) < 1e-3:
            break
    return centre


@compiled
def _fir(samples: NDArray[np.float64], first: int, last: int, left: float, right: float) -> float:
    """Of the zero crossings of the filtered profile, the one nearest to the middle of the stripe."""
    order = max(2, math.ceil(right - left))
    middle = round(0.5 * (left + right))
    order = min(order, middle - first - 1, last - middle - 1)
    best = math.nan
    for k in range(middle - 2, middle + 2):
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
    """What lies before sample k less what lies after it."""
    total = 0.0
    for n in range(1, order + 1):
        total += samples[k - n] - samples[k + n]
    return total

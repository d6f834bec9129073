"""Faint, narrow lines on bright surfaces: a few grey levels above a lit board, in pictures with texture and edges.

Single pixels of such a line are hardly brighter or redder than their surroundings are by chance. Three things separate
it from them: its colour relative to that of the surface, the shape of its profile, and its length.

The surface around a pixel gives the ratio of red to the other colours. What a pixel has more of red is the laser's:
paper, print and shade, bright or dark, have the colour of their surroundings. Ridges of this excess are searched for,
and a Gaussian line with a level and a slope is fitted to their profiles by least squares, which for white noise reaches
the Cramer-Rao bound (S. M. Kay, "Fundamentals of Statistical Signal Processing: Estimation Theory", 1993, chapter 7):
once to the excess, and once to red alone. Red is sharper, since cameras keep fewer colours than pixels, but only where
the surface is even. Both centres are averaged with weights from the residuals of the fits.

Noise has ridges, too, but they are short, and as weak as most of the ridges in the picture.
"""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.chain import is_sharpest, pieces_of, place
from footscan.stripe.loop_parameters import LoopParameters
from footscan.stripe.profile import COLUMNS, CONTRAST, LIGHT, REDNESS, SATURATION, SYMMETRY, WIDTH
from footscan.stripe.redness import SIGNAL_SCALE
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, SHARPNESS, SPACING_PX, I, J, find_ridges

BOX = 31
"""Side of the surroundings whose colour a pixel is compared with, in px of the half-size image: wider than a square of
a chessboard. Chosen by hand, as all that follows, on pictures of 30 drawn boards, with lines of 5 to 25 grey levels."""
SCALE, ZERO = 16.0, 4000.0
"""The search for ridges takes whole numbers: its units a grey level of excess, and its value for none."""
FAINTEST = 0.3
"""Excess in grey levels of the faintest ridge that is looked at."""
NARROW_PX, WIDENED_PX = (1.0, 1.2), (1.3, 2.0)
"""Standard deviations in px, in red and in the excess, of a narrow line, and of one that mosaic and compression have
widened. Those are used that find more of a line."""
SHARED_COLOUR, APART = 0.48, 4
"""Difference in colour of neighbours, relative to that of pixels so far apart, below which compression has widened all
colours: 0.3 to 0.4 in JPEG pictures (4:2:0), 0.6 with a mosaic alone, 0.9 to 1 without both."""
MOST_DIFFERENCE = 8.0
"""Grey levels at which those differences are cut: noise counts, not edges."""
REACH, LEAST_REACH = 3.5, 4
"""Half length of a profile: in standard deviations of the line, and in samples at least, nine for four unknowns."""
BESIDE = 2.5
"""How far from the centre, in standard deviations, samples show the surface alone."""
STEPS, SMALLEST_MOVE = 4, 1e-3
"""Gauss-Newton steps at most, a bound of time; and the step, in samples, below which they end."""
FARTHEST_PX = 1.5
"""How far a centre may lie from its ridge, px: a ridge is found to half a pixel of the half-size image."""
SIGNIFICANT = 2.0
"""Height of a line, in standard deviations of its fit."""
SHARED = 4.0
"""Factor on the standard deviation of centres from the excess. Mosaic and compression give neighbouring pixels the same
colour, so that the residuals are too small."""
AGREE = 3.0
"""Difference of the two centres, in its standard deviations."""
UNEVEN = 5.0
"""Difference of levels of the surface beside the line, relative to the excess of the line, beyond which red does not
show the line's centre."""
WORST_PX = 0.4
"""Largest standard deviation of a centre."""
LEAST_NOISE = 0.2
"""Usual height of ridges of noise, in grey levels of excess, at least: rounding."""
ABOVE_NOISE, PIECE = 1.4, 10.0
"""Mean height of a piece, and the sum of its heights, in units of the usual height of ridges of noise."""
STRONG, STRONG_PIECE, STRONG_PX, CERTAIN = 2.5, 30.0, 24.0, 7.0
"""The same of the strongest piece at least, its length, and the mean of its heights in standard deviations of the fit.
Compression makes weak ridges of its own, at most as long as its blocks of 16 px."""
AS_STRONG = 0.6
"""Mean height of a piece, relative to that of all strong pieces."""
LEAST_COLOURED, MOST_COLOURED = 0.25, 1.3
"""Ratio of excess to red in the light of a piece: an edge of the print has hardly any excess, and a laser adds no more
excess than red."""
MAJORITY = 0.5
"""Share of a piece that lies on an even surface: at edges of a print, mosaic and compression make coloured fringes."""
FWHM = 2.0 * math.sqrt(2.0 * math.log(2.0))
"""Full width at half height of a Gaussian, in standard deviations."""


@compiled
def find_line(
    words: NDArray[np.uint32], kernel: NDArray[np.float32], limits: LoopParameters, gap: float, shortest: float
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Find the profiles of a faint line.

    Parameters
    ----------
    words : (rows, columns) uint32, the pixels of a frame, brought to red.
    kernel : the weights of the smoothing for `find_ridges`.
    gap, shortest : px, as in `ExtractionParameters`.

    Returns
    -------
    profiles : (N, 11) float64, the columns of `measure_profiles`; the redness is the height of the line's excess.
    piece : (N,) int32, the piece of each profile.
    """
    rows, columns = words.shape
    excess, ratio = excess_of(words)
    sensitive = LoopParameters(0, limits.saturation, FAINTEST, limits.largest_width, limits.centre_level, limits.method)
    everywhere = np.zeros(excess.shape, np.uint16)
    ridges = np.empty((0, 5))
    ridges = np.empty((find_ridges(everywhere, excess, kernel, sensitive, ridges), 5))
    find_ridges(everywhere, excess, kernel, sensitive, ridges)
    best, best_piece, most = np.empty((0, COLUMNS)), np.empty(0, np.int32), 0.0
    for sigmas in (WIDENED_PX, NARROW_PX):
        if sigmas == NARROW_PX and _shared_colour(words) < SHARED_COLOUR:
            continue
        profiles, heights = _fit_profiles(words, ratio, ridges, sigmas)
        profiles = profiles[is_sharpest(profiles, place(profiles, rows, columns))]
        piece, count = pieces_of(profiles, gap, place(profiles, rows, columns))
        noise = max(float(np.median(heights)), LEAST_NOISE) if len(heights) else LEAST_NOISE
        kept = _is_laser_line(profiles, piece, count, noise, shortest)
        found = profiles[kept, SHARPNESS].sum()
        if found > most:
            best, best_piece, most = profiles[kept], piece[kept], found
    return best, best_piece


@compiled
def excess_of(words: NDArray[np.uint32]) -> tuple[NDArray[np.uint16], NDArray[np.float64]]:
    """Compute the excess of red over what the surroundings' colour predicts, in the half-size image.

    Returns
    -------
    excess : (ceil(rows / 2), ceil(columns / 2)) uint16, `ZERO` plus `SCALE` a grey level.
    ratio : of the same shape, float64, of red to the mean of the other colours in the surroundings.
    """
    rows, columns = (words.shape[0] + 1) // 2, (words.shape[1] + 1) // 2
    red, others = np.empty((rows, columns)), np.empty((rows, columns))
    for y in range(rows):
        upper, lower = words[2 * y], words[min(2 * y + 1, words.shape[0] - 1)]
        for x in range(columns):
            beside = min(2 * x + 1, words.shape[1] - 1)
            a, b = _colours(upper[2 * x]), _colours(upper[beside])
            c, d = _colours(lower[2 * x]), _colours(lower[beside])
            red[y, x] = 0.25 * (a[0] + b[0] + c[0] + d[0])
            others[y, x] = 0.25 * (a[1] + b[1] + c[1] + d[1])
    ratio = _box_sums(red) / np.maximum(_box_sums(others), 1.0)
    excess = np.empty((rows, columns), np.uint16)
    for y in range(rows):
        for x in range(columns):
            more = red[y, x] - ratio[y, x] * others[y, x]
            excess[y, x] = min(max(round(SCALE * more + ZERO), 0), 65535)
    return excess, ratio


@compiled
def _shared_colour(words: NDArray[np.uint32]) -> float:
    """The mean difference in colour of neighbours in a row, relative to that of pixels `APART`."""
    near = far = 1e-9
    for j in range(0, words.shape[0], 2):
        for i in range(words.shape[1] - APART):
            here, beside, apart = _colours(words[j, i]), _colours(words[j, i + 1]), _colours(words[j, i + APART])
            own = here[0] - here[1]
            near += min(abs(beside[0] - beside[1] - own), MOST_DIFFERENCE)
            far += min(abs(apart[0] - apart[1] - own), MOST_DIFFERENCE)
    return near / far


@compiled
def _box_sums(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums over squares of `BOX` px around each pixel, as far as they are inside the image."""
    rows, columns = image.shape
    sums = np.zeros((rows + 1, columns + 1))
    for y in range(rows):
        line = 0.0
        for x in range(columns):
            line += image[y, x]
            sums[y + 1, x + 1] = sums[y, x + 1] + line
    boxes = np.empty((rows, columns))
    for y in range(rows):
        top, bottom = max(y - BOX // 2, 0), min(y + BOX // 2 + 1, rows)
        for x in range(columns):
            left, right = max(x - BOX // 2, 0), min(x + BOX // 2 + 1, columns)
            boxes[y, x] = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
    return boxes


@compiled
def _colours(word: np.uint32) -> tuple[float, float]:
    """Red, and the mean of green and blue."""
    byte = np.uint32(0xFF)
    red, green, blue = word & byte, (word >> np.uint32(8)) & byte, (word >> np.uint32(16)) & byte
    return float(np.int64(red)), 0.5 * float(np.int64(green + blue))


@compiled
def _fit_profiles(
    words: NDArray[np.uint32], ratio: NDArray[np.float64], ridges: NDArray[np.float64], sigmas: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fit lines across the ridges; the profiles that show one, and the heights (N,) of all."""
    profiles, heights = np.empty((len(ridges), COLUMNS)), np.zeros(len(ridges))
    sigma, wide = sigmas
    size = 2 * math.ceil(REACH * wide * math.sqrt(2.0)) + 1
    red, excess = np.empty(size), np.empty(size)
    count = 0
    for n in range(len(ridges)):
        normal_i, normal_j = ridges[n, NORMAL_I], ridges[n, NORMAL_J]
        upright = abs(normal_j) >= abs(normal_i)
        across, along = (normal_j, normal_i) if upright else (normal_i, normal_j)
        ridge, other = (ridges[n, J], ridges[n, I]) if upright else (ridges[n, I], ridges[n, J])
        slope, step = along / across, 1 / abs(across)
        at = round(ridge)
        reach = max(math.ceil(REACH * wide / step), LEAST_REACH)
        last = 2 * reach + 1
        if not _sample(words, ratio, upright, at, other + (at - ridge) * slope, slope, reach, red, excess):
            continue
        start = ridge - at + reach
        centre, height, deviation, spread = _fit(excess[:last], start, wide / step)
        heights[n] = height
        if not height > SIGNIFICANT * deviation or abs(centre - start) * step > FARTHEST_PX:
            continue
        centre, bright, is_even = _best_centre(red[:last], height, centre, SHARED * spread, sigma, step)
        if math.isnan(centre):
            continue
        move = centre - start
        profiles[count, I] = ridges[n, I] + (move * slope if upright else move)
        profiles[count, J] = ridges[n, J] + (move if upright else move * slope)
        profiles[count, NORMAL_I], profiles[count, NORMAL_J] = normal_i, normal_j
        profiles[count, SHARPNESS] = height / deviation
        profiles[count, WIDTH], profiles[count, CONTRAST] = FWHM * sigma, SIGNAL_SCALE * bright
        profiles[count, SYMMETRY], profiles[count, SATURATION] = 1.0 if is_even else 0.5, 0.0
        profiles[count, LIGHT] = profiles[count, REDNESS] = height
        count += 1
    return profiles[:count], heights


@compiled
def _best_centre(
    red: NDArray[np.float64], height: float, centre: float, spread: float, sigma_px: float, step: float
) -> tuple[float, float, bool]:
    """Improve the centre of the excess by that of red; NaN if it is not certain. Also the height of red, and whether
    the surface is even.

    height, centre, spread : of the line in the excess, and the standard deviation of the centre; a sample is `step` px.
    """
    sigma = sigma_px / step
    near = max(math.ceil(REACH * sigma), LEAST_REACH)
    first = max(red.size // 2 - near, 0)
    own, bright, deviation, own_spread = _fit(red[first : red.size - first], centre - first, sigma)
    own += first
    if not bright > SIGNIFICANT * deviation or abs(own - centre) * step > FARTHEST_PX:
        return math.nan, bright, False
    least, most = math.inf, -math.inf
    for k in range(red.size):
        if abs(k - own) > BESIDE * sigma:
            least, most = min(least, red[k]), max(most, red[k])
    variance = spread * spread
    is_even = most - least <= UNEVEN * height
    if is_even:
        both = variance + own_spread * own_spread
        if abs(own - centre) > AGREE * math.sqrt(both):
            return math.nan, bright, False
        centre += variance / both * (own - centre)
        variance *= own_spread * own_spread / both
    return (centre if math.sqrt(variance) * step <= WORST_PX else math.nan), bright, is_even


@compiled
def _sample(
    words: NDArray[np.uint32],
    ratio: NDArray[np.float64],
    upright: bool,
    at: int,
    beside: float,
    slope: float,
    reach: int,
    red: NDArray[np.float64],
    excess: NDArray[np.float64],
) -> bool:
    """Sample red and its excess along the normal, 2 reach + 1 values each; False if the normal leaves the image."""
    lines, pixels = words.shape if upright else (words.shape[1], words.shape[0])
    if at < reach or at + reach >= lines:
        return False
    for k in range(-reach, reach + 1):
        place = beside + k * slope
        cell, line = math.floor(place), at + k
        if cell < 0 or cell + 1 >= pixels:
            return False
        part = place - cell
        if upright:
            a, b, own = _colours(words[line, cell]), _colours(words[line, cell + 1]), ratio[line // 2, cell // 2]
        else:
            a, b, own = _colours(words[cell, line]), _colours(words[cell + 1, line]), ratio[cell // 2, line // 2]
        red[k + reach] = (1 - part) * a[0] + part * b[0]
        excess[k + reach] = red[k + reach] - own * ((1 - part) * a[1] + part * b[1])
    return True


@compiled
def _fit(samples: NDArray[np.float64], start: float, sigma: float) -> tuple[float, float, float, float]:
    """Least squares of level + slope x + height exp(-(x - centre)^2 / 2 sigma^2).

    The model is linear in all but the centre, which moves by Gauss-Newton steps: by the coefficient of the line's own
    derivative, relative to its height.

    Returns
    -------
    centre, height, standard deviation of the height, standard deviation of the centre; the height is 0 without a line.
    """
    middle = 0.5 * (samples.size - 1)
    centre = start
    normal, right, basis = np.empty((4, 4)), np.empty(4), np.empty(4)
    height = deviation = spread = 0.0
    for _ in range(STEPS):
        normal[:] = 0.0
        right[:] = 0.0
        square = 0.0
        for k in range(samples.size):
            t = (k - centre) / sigma
            line = math.exp(-0.5 * t * t)
            basis[0], basis[1], basis[2], basis[3] = line, line * t / sigma, 1.0, k - middle
            for a in range(4):
                right[a] += basis[a] * samples[k]
                for b in range(4):
                    normal[a, b] += basis[a] * basis[b]
            square += samples[k] * samples[k]
        inverse = np.linalg.inv(normal)
        found = inverse @ right
        height = found[0]
        if not height > 0:
            return centre, 0.0, 1.0, math.inf
        # Rounding to grey levels alone has a variance of 1 / 12.
        variance = max((square - found @ right) / (samples.size - 4), 1 / 12)
        deviation, spread = math.sqrt(variance * inverse[0, 0]), math.sqrt(variance * inverse[1, 1]) / height
        move = min(max(found[1] / height, -1.0), 1.0)
        centre += move
        if abs(move) < SMALLEST_MOVE:
            break
    return centre, height, deviation, spread


@compiled
def _is_laser_line(
    profiles: NDArray[np.float64], piece: NDArray[np.int32], count: int, noise: float, shortest: float
) -> NDArray[np.bool_]:
    """Select the profiles (N,) of pieces that are long, of the laser's colour, and stronger than ridges of noise."""
    points, height, red, even = np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count)
    certainty = np.zeros(count)
    for a in range(len(profiles)):
        points[piece[a]] += 1
        certainty[piece[a]] += profiles[a, SHARPNESS]
        even[piece[a]] += profiles[a, SYMMETRY] == 1.0
        height[piece[a]] += profiles[a, REDNESS] / noise
    for p in range(count):
        red[p] = np.median(profiles[piece == p, CONTRAST]) / (SIGNAL_SCALE * noise)
    mean = height / points
    kept = (SPACING_PX * points >= shortest) & (mean >= ABOVE_NOISE)
    kept &= (mean >= LEAST_COLOURED * red) & (mean <= MOST_COLOURED * red)
    kept &= even >= MAJORITY * points
    strong = kept & (height >= STRONG_PIECE) & (SPACING_PX * points >= STRONG_PX)
    strong &= (mean >= STRONG) & (certainty >= CERTAIN * points)
    if not strong.any():
        return np.zeros(len(profiles), np.bool_)
    usual = height[strong].sum() / points[strong].sum()
    kept &= (height >= PIECE) & (mean >= AS_STRONG * usual)
    return kept[piece]

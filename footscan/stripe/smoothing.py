"""Noise of the centres along the stripe, and smoothing that does not round corners.

Each centre is moved to a parabola through its neighbours along the stripe. The window grows until the confidence
intervals of its estimates have no common point (A. Goldenshluger and A. Nemirovski, "On spatially adaptive estimation
of nonparametric regression", Mathematical Methods of Statistics 6(2), 1997; V. Katkovnik, "A new method for varying
adaptive bandwidth selection", IEEE Transactions on Signal Processing 47(9), 1999, doi:10.1109/78.782208). At a corner
the window is short, and hardly anything is smoothed.
"""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.robust import MAD_TO_SD
from footscan.stripe.profile import WIDTH
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, SPACING_PX, I, J

JOINED = 1.5
"""Factor on the variance of an estimate, since neighbours are correlated: so many count as one independent point.
Chosen by hand."""
INTERVAL = 1.6
"""Half width of a confidence interval, in standard deviations. Chosen by hand."""
SHORTEST, GROWTH = 2, 1.4
"""Steps on either side of the first window, and the ratio of the next window to the last. Chosen by hand."""
STRAIGHT = 0.9
"""Cosine of the largest angle by which the stripe turns within a window: 26 degrees, which a parabola still follows.
Chosen by hand."""
FLOOR_PX = 0.02
"""Standard deviation that remains when all noise is smoothed away: sampling, lens and compression. Chosen by hand."""
PRIOR_PX = 0.06
"""Noise of the centre of a stripe 1 px wide, used where too few points show it. Chosen by hand."""
LEAST_NOISE_PX = 1e-3
"""Lowest noise of the centre of a stripe 1 px wide: keeps the confidence intervals from vanishing."""
FEWEST = 12
"""Third differences from which the noise is taken at least. Chosen by hand."""


@compiled
def smooth_along(
    profiles: NDArray[np.float64], chain: NDArray[np.int32], widths: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Smooth the centres along the stripe.

    Parameters
    ----------
    profiles : (N, 11) float64, the columns of `measure_profiles`, in their order along the stripe.
    chain : (N,) int32, the number of each point's chain.
    widths : half length of the longest window, in widths of the stripe; 0 moves no point.

    Returns
    -------
    moves : (N,) float64, by how much each point is to be moved along its normal, px.
    sigmas : (N,) float64, the standard deviation of its centre afterwards, px.

    Examples
    --------
    The centre of a straight stripe that lies 0.3 px off is moved back:

    >>> from footscan.stripe.profile import COLUMNS
    >>> profiles = np.zeros((21, COLUMNS))
    >>> profiles[:, I], profiles[:, J], profiles[:, NORMAL_J] = np.arange(0, 42, 2), 100.0, 1.0
    >>> profiles[:, WIDTH] = 6.0
    >>> profiles[10, J] += 0.3
    >>> moves, sigmas = smooth_along(profiles, np.zeros(21, np.int32), 3.0)
    >>> print(bool(moves[10] < -0.1), bool(np.all(np.abs(moves[[0, -1]]) < 0.01)))
    True True
    """
    count = len(profiles)
    unit = _noise(profiles, chain)
    moves, sigmas = np.zeros(count), np.empty(count)
    for a in range(count):
        own = unit * math.sqrt(profiles[a, WIDTH])
        sigmas[a] = math.sqrt(own * own + FLOOR_PX * FLOOR_PX)
        normal_i, normal_j = profiles[a, NORMAL_I], profiles[a, NORMAL_J]
        centre_i, centre_j = profiles[a, I], profiles[a, J]
        reach = int(widths * profiles[a, WIDTH] / SPACING_PX)
        low, high = -math.inf, math.inf
        n = 1.0
        s1 = s2 = s3 = s4 = t0 = t1 = t2 = 0.0
        window = min(SHORTEST, reach)
        for m in range(1, reach + 1):
            if a < m or a + m >= count or chain[a - m] != chain[a] or chain[a + m] != chain[a]:
                break
            before = abs(normal_i * profiles[a - m, NORMAL_I] + normal_j * profiles[a - m, NORMAL_J])
            after = abs(normal_i * profiles[a + m, NORMAL_I] + normal_j * profiles[a + m, NORMAL_J])
            if min(before, after) < STRAIGHT:
                break
            for b in (a - m, a + m):
                d_i, d_j = profiles[b, I] - centre_i, profiles[b, J] - centre_j
                x, y = d_j * normal_i - d_i * normal_j, d_i * normal_i + d_j * normal_j
                square = x * x
                s1 += x
                s2 += square
                s3 += square * x
                s4 += square * square
                t0 += y
                t1 += x * y
                t2 += square * y
            n += 2
            if m < window:
                continue
            window = min(math.ceil(m * GROWTH), reach)
            # The inverse normal matrix's first row gives the parabola's value at 0 and its variance for unit noise.
            c0, c1, c2 = s2 * s4 - s3 * s3, s2 * s3 - s1 * s4, s1 * s3 - s2 * s2
            determinant = n * c0 + s1 * c1 + s2 * c2
            if not determinant > 0:
                break
            estimate = (c0 * t0 + c1 * t1 + c2 * t2) / determinant
            sigma = own * min(1.0, math.sqrt(JOINED * c0 / determinant))
            low, high = max(low, estimate - INTERVAL * sigma), min(high, estimate + INTERVAL * sigma)
            if low > high:
                break
            moves[a] = estimate
            sigmas[a] = math.sqrt(sigma * sigma + FLOOR_PX * FLOOR_PX)
    return moves, sigmas


@compiled
def _noise(profiles: NDArray[np.float64], chain: NDArray[np.int32]) -> float:
    """Standard deviation of the centres, px, for a stripe 1 px wide; it grows with the square root of the width.

    It is taken from third differences of points two steps apart. A line and an even bend cancel in them, and the noise
    of four points remains (1, 9, 9 and 1 times its variance). The median is not affected by the few corners.
    """
    off = np.empty(len(profiles))
    count = 0
    for a in range(3, len(profiles) - 3):
        b, c = a - 3, a + 3
        if chain[b] != chain[a] or chain[c] != chain[a]:
            continue
        chord_i, chord_j = profiles[c, I] - profiles[b, I], profiles[c, J] - profiles[b, J]
        d_i = chord_i - 3 * (profiles[a + 1, I] - profiles[a - 1, I])
        d_j = chord_j - 3 * (profiles[a + 1, J] - profiles[a - 1, J])
        length = math.sqrt(chord_i * chord_i + chord_j * chord_j)
        if length > 0:
            off[count] = abs(d_i * chord_j - d_j * chord_i) / (length * math.sqrt(20 * profiles[a, WIDTH]))
            count += 1
    if count < FEWEST:
        return PRIOR_PX
    return max(MAD_TO_SD * float(np.median(off[:count])), LEAST_NOISE_PX)

"""The colours of the skin under the points of the stripe, from frames with the laser off."""

from collections.abc import Callable
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.frames.image import Rgb
from footscan.robust import MAD_TO_SD
from footscan.stripe.points import StripePoints

Singles = NDArray[np.float32]

WIDEST_PX = 3.0
"""Largest half width of the window for a point's colour, in px: beyond, the skin may end. Chosen by hand."""
CLIPPED = 250
"""Level from which a channel may be saturated; compression lowers white by a few levels. Chosen by hand."""
CLIPPED_LIGHT = 0.95
"""Mean light of several pixels from which a channel may be saturated; level 250 is 0.956."""
CLIPPED_WEIGHT = 1e-3
"""Weight of a saturated pixel: it counts only where there is no other."""
DARKEST = 3e-4
"""Light of level 1 of 255, by the curve of sRGB: ratios of less light mean nothing."""
LEAST_SHARED = 20
"""Vertices that two cameras must both see to be compared. Chosen by hand."""
REWEIGHTINGS = 8
"""Iterations of the robust least squares: a bound of time."""
HUBER = 1.345
"""Residuals, in standard deviations, up to which a comparison counts in full (Huber 1964): 95 % efficiency for normal
errors."""
SMALLEST_BOUND = 1e-9
"""Bound of the residuals if all of them vanish: keeps a division from failing."""


def point_colours(stripe: StripePoints, laser_off: Callable[[int], Rgb | None]) -> tuple[Singles, NDArray[np.bool_]]:
    """Sample the colours of the points of one camera's stripe.

    A frame with the laser off shows the skin under the stripe at the pixels of the stripe. Its pixels are averaged with
    the weights of a pyramid around the point, as wide as the stripe. For a width of 2 px this is bilinear
    interpolation.

    Parameters
    ----------
    stripe : (N,) of `STRIPE_DTYPE`; frame, i, j and width (px) are used
    laser_off : returns the (rows, columns, 3) uint8 sRGB frame with the laser off for the number of a frame; None if
        there is none. It may return the same memory at every call. It is called for frames with points only

    Returns
    -------
    colours : (N, 3) float32, red, green and blue in linear light, 1 for white; 0 for a point without colour
    seen : (N,) bool, True for a point with a colour

    Examples
    --------
    >>> from footscan.stripe.points import STRIPE_DTYPE
    >>> stripe = np.zeros(1, STRIPE_DTYPE)
    >>> stripe["i"], stripe["j"], stripe["width"] = 4.0, 4.0, 3.0
    >>> white = np.full((9, 9, 3), 255, np.uint8)
    >>> colours, seen = point_colours(stripe, lambda frame: white)
    >>> print(colours.round(3), seen)
    [[1. 1. 1.]] [ True]
    """
    colours, seen = np.zeros((len(stripe), 3), np.float32), np.zeros(len(stripe), np.bool_)
    light = linear_light(np.arange(256) / 255)
    order = np.argsort(stripe["frame"], kind="stable")
    numbers, starts = np.unique(stripe["frame"][order], return_index=True)
    for number, (start, end) in zip(numbers.tolist(), pairwise([*starts, len(order)]), strict=True):
        frame, rows = laser_off(number), order[start:end]
        if frame is not None:
            of_frame = stripe[rows]
            half_widths = np.clip(of_frame["width"].astype(np.float64) / 2, 1.0, WIDEST_PX)
            colours[rows], seen[rows] = _averaged(frame, light, of_frame["i"], of_frame["j"], half_widths)
    return colours, seen


def camera_gains(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimate the gains of the cameras by robust least squares over the vertices that two cameras see.

    Pairs of cameras do not determine a common factor of all cameras that are linked by pairs. It is set so that the
    mean of their logarithms is 0.

    Parameters
    ----------
    sums : (V, C, 4) float64, weighted sums of each camera's linear light (red, green, blue) at V vertices, and the
        weight

    Returns
    -------
    (C, 3) float64, natural logarithms of the factors by which each camera's light is to be divided

    References
    ----------
    P. J. Huber, "Robust estimation of a location parameter", Annals of Mathematical Statistics 35(1), 1964,
    doi:10.1214/aoms/1177703732.

    Examples
    --------
    The second camera is four times as bright as the first:

    >>> sums = np.ones((30, 2, 4))
    >>> sums[:, 0, :3], sums[:, 1, :3] = 0.1, 0.4
    >>> print(np.exp(camera_gains(sums)).round(3))
    [[0.5 0.5 0.5]
     [2.  2.  2. ]]
    """
    count = sums.shape[1]
    weight = sums[:, :, 3]
    safe = np.where(weight > 0, weight, 1.0)[:, :, None]
    light = sums[:, :, :3] / safe
    usable = (weight > 0) & ~is_clipped(light)
    logs = np.log(np.maximum(light, DARKEST))
    pairs, ratios, weights = [], [np.zeros((0, 3))], [np.zeros(0)]
    for a, b in combinations(range(count), 2):
        both = usable[:, a] & usable[:, b]
        if np.count_nonzero(both) >= LEAST_SHARED:
            pairs += [(a, b)] * int(np.count_nonzero(both))
            ratios.append(logs[both, a] - logs[both, b])
            weights.append(1 / (1 / weight[both, a] + 1 / weight[both, b]))
    first, second = np.array(pairs, np.intp).reshape(-1, 2).T
    ratio, base = np.concatenate(ratios), np.concatenate(weights)
    gains, trust = np.zeros((count, 3)), np.ones(len(base))
    for _ in range(REWEIGHTINGS if len(base) else 0):
        # The normal equations are a graph's Laplacian; the pseudoinverse gives the solution with mean 0.
        strength = np.bincount(first * count + second, base * trust, minlength=count * count).reshape(count, count)
        strength += strength.T
        inverse = np.linalg.pinv(np.diag(strength.sum(axis=1)) - strength, hermitian=True)
        for channel in range(3):
            pull = base * trust * ratio[:, channel]
            total = np.bincount(first, pull, minlength=count) - np.bincount(second, pull, minlength=count)
            gains[:, channel] = inverse @ total
        left = np.sqrt(np.mean((ratio - gains[first] + gains[second]) ** 2, axis=1))
        bound = HUBER * max(MAD_TO_SD * float(np.median(left)), SMALLEST_BOUND)
        trust = bound / np.maximum(left, bound)
    return gains


def is_clipped(light: NDArray[np.float64]) -> NDArray[np.bool_]:
    """True where a channel of `light` (..., 3) may be saturated; (...).

    >>> print(is_clipped(np.array([[0.2, 0.3, 0.4], [0.99, 0.3, 0.4]])))
    [False  True]
    """
    clipped: NDArray[np.bool_] = light.max(axis=-1) >= CLIPPED_LIGHT
    return clipped


def linear_light(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert `levels` of an sRGB image to linear light, both 0 to 1 (IEC 61966-2-1).

    >>> print(linear_light(np.array([0.0, 0.5, 1.0])).round(4))
    [0.    0.214 1.   ]
    """
    return np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)


def as_level(light: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert linear `light` to levels of an sRGB image: the inverse of `linear_light`.

    >>> print(as_level(np.array([0.0, 0.214, 1.0])).round(2))
    [0.  0.5 1. ]
    """
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 0.0031308) ** (1 / 2.4) - 0.055)


@compiled
def _averaged(
    frame: Rgb,
    light: NDArray[np.float64],
    columns: NDArray[np.float64],
    rows: NDArray[np.float64],
    half_widths: NDArray[np.float64],
) -> tuple[Singles, NDArray[np.bool_]]:
    """Average the light of a frame around places (N,), in px; colours and whether the place is in the frame."""
    height, width = frame.shape[:2]
    colours, seen = np.zeros((len(columns), 3), np.float32), np.zeros(len(columns), np.bool_)
    for n in range(len(columns)):
        i, j, half = columns[n], rows[n], half_widths[n]
        if not (0.0 <= i <= width - 1.0 and 0.0 <= j <= height - 1.0):
            continue
        total = red = green = blue = 0.0
        for row in range(max(int(np.ceil(j - half)), 0), min(int(j + half), height - 1) + 1):
            for column in range(max(int(np.ceil(i - half)), 0), min(int(i + half), width - 1) + 1):
                weight = (half - abs(row - j)) * (half - abs(column - i))
                r, g, b = frame[row, column, 0], frame[row, column, 1], frame[row, column, 2]
                if max(r, g, b) >= CLIPPED:
                    weight *= CLIPPED_WEIGHT
                red, green, blue = red + weight * light[r], green + weight * light[g], blue + weight * light[b]
                total += weight
        colours[n, 0], colours[n, 1], colours[n, 2] = red / total, green / total, blue / total
        seen[n] = True
    return colours, seen

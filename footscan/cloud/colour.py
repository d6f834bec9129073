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
"""Beyond so many pixels nothing counts for a point's colour, be the stripe ever so wide: the skin may end there."""
CLIPPED = 250
"""A level from which on a channel may have been cut off; compression takes some off white."""
CLIPPED_LIGHT = 0.95
"""The same of a mean of pixels, in light; the level's is 0.956."""
CLIPPED_WEIGHT = 1e-3
"""What is cut off counts only where there is nothing else."""
DARKEST = 3e-4
"""Light of the first level of a picture: ratios of less say nothing."""
LEAST_SHARED = 20
"""Two cameras that see fewer of them in common are not compared."""
REWEIGHTINGS = 8
HUBER = 1.345


def point_colours(stripe: StripePoints, laser_off: Callable[[int], Rgb | None]) -> tuple[Singles, NDArray[np.bool_]]:
    """The colours of the points of one camera's stripe.

    A frame with the laser off shows the skin that the stripe lies on at the very pixels of the stripe. Its pixels are
    averaged under a pyramid around the point, as wide as the stripe; where that is two pixels, this is bilinear
    interpolation.

    Parameters
    ----------
    stripe : (N,) of `STRIPE_DTYPE`; frame, i, j and width (px) are used
    laser_off : gives the (rows, columns, 3) sRGB frame of a number, taken where the film's frame of this number was;
        None where there is none. It may be the same memory at every call. Only frames with points are asked for

    Returns
    -------
    colours : (N, 3) red, green and blue in linear light, 1 being white; 0 where there is none
    seen : (N,) whether there is one
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
    """(C, 3) logarithms of what each camera's light is divided by.

    Robust least squares (Huber 1964) over what each two cameras see at the same vertices. What no pair can tell, that
    all cameras, or all that are linked by pairs, are lighter alike, is settled by their logarithms' mean, 0.

    Parameters
    ----------
    sums : (V, C, 4) weighted light of each camera at some vertices, and its weight
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
        bound = HUBER * max(MAD_TO_SD * float(np.median(left)), 1e-9)
        trust = bound / np.maximum(left, bound)
    return gains


def is_clipped(light: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(...) of (..., 3) whether a channel may have been cut off."""
    clipped: NDArray[np.bool_] = light.max(axis=-1) >= CLIPPED_LIGHT
    return clipped


def linear_light(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light of the `levels` of a picture, both 0 to 1, by the curve of IEC 61966-2-1 (sRGB)."""
    return np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)


def as_level(light: NDArray[np.float64]) -> NDArray[np.float64]:
    """Levels of `light`, the inverse of `linear_light`."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 0.0031308) ** (1 / 2.4) - 0.055)


@compiled
def _averaged(
    frame: Rgb,
    light: NDArray[np.float64],
    columns: NDArray[np.float64],
    rows: NDArray[np.float64],
    half_widths: NDArray[np.float64],
) -> tuple[Singles, NDArray[np.bool_]]:
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

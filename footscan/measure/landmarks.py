"""Landmarks of a right foot in its own frame: mm, heel towards -X, toes towards +X, medial side towards +Y, Z up.

All take (N, 3) `samples` spread evenly over the surface, one for each `SAMPLE_MM2`, and the foot length in mm; windows
are fractions of it.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from schemas.errors import Finding

SAMPLE_MM2 = 0.5
LOW_MM = 60.0
"""Below this height there is foot and no leg; the rearmost heel point is 15 to 35 mm high."""
TIP_SAMPLES = 8
"""So many samples, 4 mm² of the surface, may lie beyond what is taken for its end: noise and strays must not make a
foot longer. On a toe of 10 mm radius that cuts off 0.06 mm."""
TOE_SPACING_MM = 8.0
TOE_PROMINENCE_MM = 0.5
TIP_DEPTH_MM = 1.0
"""A toe's tip is in the middle of what lies less than this behind its foremost point; blunt toes have no other."""
MEDIAL_BALL = (0.66, 0.80)
LATERAL_BALL = (0.56, 0.72)

Point = NDArray[np.float64]
"""(3,) mm"""


def highest(values: NDArray[np.float64]) -> float:
    """The highest of (N,) `values` of samples, `TIP_SAMPLES` left out."""
    skip = min(TIP_SAMPLES, len(values) - 1)
    return float(np.partition(values, -1 - skip)[-1 - skip])


def lowest(values: NDArray[np.float64]) -> float:
    """The lowest of (N,) `values` of samples, `TIP_SAMPLES` left out."""
    return -highest(-values)


def pternion(samples: NDArray[np.float64]) -> Point:
    """The rearmost point of the heel."""
    low = samples[samples[:, 2] <= LOW_MM]
    return _cap(low, axis=0, sign=-1, depth=2.0)


def length_from(samples: NDArray[np.float64], x: float) -> float:
    """How far the longest toe lies ahead of `x`."""
    return highest(samples[samples[:, 2] <= LOW_MM, 0]) - x


def is_right(samples: NDArray[np.float64]) -> bool:
    """Whether the big toe is on the +Y side: the outer quarter on its side reaches farther ahead."""
    low = samples[samples[:, 2] <= LOW_MM]
    toes = low[low[:, 0] > np.quantile(low[:, 0], 0.6)]
    right, left = lowest(toes[:, 1]), highest(toes[:, 1])
    quarter = (left - right) / 4
    on_left, on_right = toes[toes[:, 1] > left - quarter, 0], toes[toes[:, 1] < right + quarter, 0]
    return highest(on_left) >= highest(on_right)


def second_toe_tip(samples: NDArray[np.float64], length: float) -> Point | None:
    """The tip of the second toe, counted from the medial side; None where toes cannot be told apart."""
    from scipy.signal import find_peaks  # half a second that other commands need not wait for

    toes = samples[(samples[:, 2] <= LOW_MM) & (samples[:, 0] >= 0.8 * length)]
    if not len(toes):
        return None
    strip = np.floor(toes[:, 1]).astype(np.intp)  # 1 mm wide
    silhouette = np.full(int(np.ptp(strip)) + 3, 0.8 * length)
    np.maximum.at(silhouette, strip - strip.min() + 1, toes[:, 0])
    smooth = gaussian_filter1d(silhouette, 1.5, mode="nearest")
    tips, _ = find_peaks(smooth, distance=TOE_SPACING_MM, prominence=TOE_PROMINENCE_MM)
    if len(tips) < 2:
        return None
    tip = int(tips[-2])
    below = np.flatnonzero(smooth < smooth[tip] - TIP_DEPTH_MM)
    left, right = below[below < tip].max(initial=-1) + 1, below[below > tip].min(initial=len(smooth)) - 1
    return np.array([smooth[tip], (left + right) / 2 - 1 + strip.min() + 0.5, 0.0])


def metatarsale_tibiale(samples: NDArray[np.float64], length: float) -> Point:
    """The most medial point of the head of the first metatarsal."""
    window = _between(samples, MEDIAL_BALL, length, height=45.0)
    return _cap(window, axis=1, sign=1, depth=0.5)


def metatarsale_fibulare(samples: NDArray[np.float64], length: float) -> Point:
    """The most lateral point of the head of the fifth metatarsal."""
    window = _between(samples, LATERAL_BALL, length, height=40.0)
    return _cap(window, axis=1, sign=-1, depth=0.5)


def _between(
    samples: NDArray[np.float64], window: tuple[float, float], length: float, height: float
) -> NDArray[np.float64]:
    x, z = samples[:, 0], samples[:, 2]
    return samples[(x >= window[0] * length) & (x <= window[1] * length) & (z <= height)]


def _cap(samples: NDArray[np.float64], axis: int, sign: int, depth: float) -> Point:
    """Middle of the cap of `depth` mm at the samples' end along `axis`, moved out to that end."""
    if not len(samples):
        raise Finding("the surface has no points where a landmark of a foot is expected")
    outward = sign * samples[:, axis]
    top = highest(outward)
    middle: Point = samples[outward >= top - depth].mean(axis=0)
    middle[axis] = sign * top
    return middle

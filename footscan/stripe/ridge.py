"""The ridge of the stripe: where the smoothed signal is highest across it, and which way across is.

C. Steger, "An unbiased detector of curvilinear structures", IEEE TPAMI 20(2), 1998, doi:10.1109/34.659930. The Hessian
gives the normal; the centre is left to the profile along it (`footscan.stripe.profile`).
"""

import math

import numba
import numpy as np
from numpy.typing import NDArray

from footscan.stripe.redness import BLOCK

LOOSE = 0.6
"""How far in px a ridge may lie from the pixel that claims it: a little over a half, so that none falls between two."""

ROUND = 0.5
"""Curvature along the ridge, relative to that across, from which it is a spot or the end of a stripe."""


def gaussian(sigma: float) -> NDArray[np.float32]:
    """The weights of a Gaussian, cut off at three standard deviations, `sigma` in px."""
    radius = math.ceil(3 * sigma)
    weights: NDArray[np.float64] = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    return np.asarray(weights / weights.sum(), np.float32)


@numba.njit(cache=True, nogil=True)
def find_ridges(
    signal: NDArray[np.uint16],
    mask: NDArray[np.uint8],
    active: NDArray[np.uint8],
    kernel: NDArray[np.float32],
    smallest_curvature: float,
    ridges: NDArray[np.float64],
) -> int:
    """Writes i, j, unit normal and curvature of each ridge crossing into `ridges`, (capacity, 5); how many these are.

    A stripe that runs along the rows is crossed once a column, one that runs along the columns once a row. Only pixels
    of the mask, in blocks that are `active`, are looked at; `smallest_curvature` is in levels of the signal per px^2.
    """
    rows, columns = signal.shape
    radius = kernel.size // 2
    side = BLOCK + 2
    patch = np.empty((side + 2 * radius, side + 2 * radius), np.float32)
    along = np.empty((side + 2 * radius, side), np.float32)
    smooth = np.empty((side, side), np.float32)
    count = 0
    for block_j in range(active.shape[0]):
        for block_i in range(active.shape[1]):
            if not active[block_j, block_i]:
                continue
            top, left = block_j * BLOCK, block_i * BLOCK
            for y in range(patch.shape[0]):
                j = min(max(top - 1 - radius + y, 0), rows - 1)
                for x in range(patch.shape[1]):
                    i = min(max(left - 1 - radius + x, 0), columns - 1)
                    patch[y, x] = signal[j, i]
            _smooth(patch, kernel, along, smooth)
            for j in range(top, min(rows, top + BLOCK)):
                for i in range(left, min(columns, left + BLOCK)):
                    if mask[j, i] and _cross(smooth, i - left + 1, j - top + 1, smallest_curvature, ridges[count]):
                        ridges[count, 0] += i
                        ridges[count, 1] += j
                        count += 1
    return count


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _smooth(
    patch: NDArray[np.float32], kernel: NDArray[np.float32], along: NDArray[np.float32], smooth: NDArray[np.float32]
) -> None:
    side = smooth.shape[0]
    for y in range(along.shape[0]):
        for x in range(side):
            along[y, x] = 0
        for k in range(kernel.size):
            for x in range(side):
                along[y, x] += kernel[k] * patch[y, x + k]
    for y in range(side):
        for x in range(side):
            smooth[y, x] = 0
        for k in range(kernel.size):
            for x in range(side):
                smooth[y, x] += kernel[k] * along[y + k, x]


@numba.njit(cache=True, nogil=True)
def _cross(smooth: NDArray[np.float32], x: int, y: int, smallest_curvature: float, ridge: NDArray[np.float64]) -> bool:
    """Whether the ridge crosses the pixel; offset (i, j) of the crossing and unit normal go into `ridge`."""
    here = smooth[y, x]
    d_i = 0.5 * (smooth[y, x + 1] - smooth[y, x - 1])
    d_j = 0.5 * (smooth[y + 1, x] - smooth[y - 1, x])
    d_ii = smooth[y, x + 1] - 2 * here + smooth[y, x - 1]
    d_jj = smooth[y + 1, x] - 2 * here + smooth[y - 1, x]
    d_ij = 0.25 * (smooth[y + 1, x + 1] - smooth[y + 1, x - 1] - smooth[y - 1, x + 1] + smooth[y - 1, x - 1])
    half_difference = 0.5 * (d_ii - d_jj)
    root = math.hypot(half_difference, d_ij)
    curvature = 0.5 * (d_ii + d_jj) - root  # the lower eigenvalue of the Hessian
    if curvature > -smallest_curvature or curvature + 2 * root < ROUND * curvature:
        return False
    angle = 0.5 * math.atan2(-d_ij, -half_difference)  # of its eigenvector
    normal_i, normal_j = math.cos(angle), math.sin(angle)
    distance = -(d_i * normal_i + d_j * normal_j) / curvature
    ridge[0] = ridge[1] = 0.0
    if abs(normal_j) >= abs(normal_i):
        ridge[1] = distance / normal_j
    else:
        ridge[0] = distance / normal_i
    ridge[2], ridge[3], ridge[4] = normal_i, normal_j, -curvature
    return bool(abs(ridge[0]) <= LOOSE and abs(ridge[1]) <= LOOSE)

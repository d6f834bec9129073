"""The plane through points, from their sums."""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]

SUMS = 10
"""Of weights, of weighted x, y, z, and of weighted xx, xy, xz, yy, yz, zz."""


@compiled
def add_point(sums: Floats, x: float, y: float, z: float, weight: float) -> None:
    """Adds a point to `sums` (10,)."""
    sums[0] += weight
    sums[1] += weight * x
    sums[2] += weight * y
    sums[3] += weight * z
    sums[4] += weight * x * x
    sums[5] += weight * x * y
    sums[6] += weight * x * z
    sums[7] += weight * y * y
    sums[8] += weight * y * z
    sums[9] += weight * z * z


@compiled
def plane_normal(sums: Floats) -> tuple[float, float, float, float, float]:
    """Unit normal x, y, z of the plane through the points of `sums` (10,), and how far these scatter.

    The last two are the variances across the plane and across the points' longest direction in it: both are 0 where
    the points lie on one line; the normal is 0 where there is no telling. The least eigenvector of the points'
    covariance, by its characteristic polynomial (O. K. Smith, Communications of the ACM 4 (1961) 168).
    """
    if sums[0] <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    mx, my, mz = sums[1] / sums[0], sums[2] / sums[0], sums[3] / sums[0]
    xx, xy, xz = sums[4] / sums[0] - mx * mx, sums[5] / sums[0] - mx * my, sums[6] / sums[0] - mx * mz
    yy, yz, zz = sums[7] / sums[0] - my * my, sums[8] / sums[0] - my * mz, sums[9] / sums[0] - mz * mz
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    spread = math.sqrt((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if not spread > 1e-9:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    angle = math.acos(min(max(determinant / (2.0 * spread**3), -1.0), 1.0)) / 3.0
    largest = mean + 2.0 * spread * math.cos(angle)
    least = mean + 2.0 * spread * math.cos(angle + 2.0 * math.pi / 3.0)
    middle = 3.0 * mean - largest - least
    # Rows of the matrix less the eigenvalue are at right angles to its eigenvector: the longest product of two is best.
    a, b, c = xx - least, yy - least, zz - least
    nx, ny, nz = xy * yz - xz * b, xz * xy - a * yz, a * b - xy * xy
    long = nx * nx + ny * ny + nz * nz
    ox, oy, oz = xy * c - xz * yz, xz * xz - a * c, a * yz - xy * xz
    other = ox * ox + oy * oy + oz * oz
    if other > long:
        nx, ny, nz, long = ox, oy, oz, other
    ox, oy, oz = b * c - yz * yz, yz * xz - xy * c, xy * yz - b * xz
    other = ox * ox + oy * oy + oz * oz
    if other > long:
        nx, ny, nz, long = ox, oy, oz, other
    if not long > 1e-24 * largest**4:
        return 0.0, 0.0, 0.0, max(least, 0.0), max(middle, 0.0)
    long = math.sqrt(long)
    return nx / long, ny / long, nz / long, max(least, 0.0), max(middle, 0.0)

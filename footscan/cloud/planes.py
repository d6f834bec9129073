"""The plane through points, from sums over the points."""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]

SUMS = 10
"""Number of sums: of the weights, of weighted x, y, z, and of weighted xx, xy, xz, yy, yz, zz."""
SMALLEST_SPREAD_MM2 = 1e-9
"""Spread of the eigenvalues, mm^2, up to which all are taken as equal: rounding."""
SINGULAR = 1e-24
"""Squared product of two rows, relative to the fourth power of the largest eigenvalue, up to which the points lie on a
line: rounding."""


@compiled
def add_point(sums: Floats, x: float, y: float, z: float, weight: float) -> None:
    """Add a point to `sums` (10,)."""
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
    """Compute the normal of the plane through the points of `sums` (10,), and the scatter of the points.

    The normal is the eigenvector of the least eigenvalue of the points' covariance, by its characteristic polynomial
    (O. K. Smith, Communications of the ACM 4(4), 1961, doi:10.1145/355578.366316).

    Returns
    -------
    Unit normal x, y, z, of either sign, 0 if it is not determined; then the variance across the plane and the variance
    across the points' longest direction in it, both 0 if the points lie on a line.

    Examples
    --------
    >>> sums = np.zeros(SUMS)
    >>> for x, y in ((0.0, 0.0), (3.0, 0.0), (0.0, 1.0), (3.0, 1.0)):
    ...     add_point(sums, x, y, 5.0, 1.0)
    >>> print([round(abs(value), 6) for value in plane_normal(sums)])
    [0.0, 0.0, 1.0, 0.0, 0.25]
    """
    if sums[0] <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    mx, my, mz = sums[1] / sums[0], sums[2] / sums[0], sums[3] / sums[0]
    xx, xy, xz = sums[4] / sums[0] - mx * mx, sums[5] / sums[0] - mx * my, sums[6] / sums[0] - mx * mz
    yy, yz, zz = sums[7] / sums[0] - my * my, sums[8] / sums[0] - my * mz, sums[9] / sums[0] - mz * mz
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    spread = math.sqrt((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if not spread > SMALLEST_SPREAD_MM2:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    angle = math.acos(min(max(determinant / (2.0 * spread**3), -1.0), 1.0)) / 3.0
    largest = mean + 2.0 * spread * math.cos(angle)
    least = mean + 2.0 * spread * math.cos(angle + 2.0 * math.pi / 3.0)
    middle = 3.0 * mean - largest - least
    # The rows of the matrix minus the eigenvalue are at right angles to its eigenvector: so is the cross product of
    # any two of them, and the longest is the most accurate.
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
    if not long > SINGULAR * largest**4:
        return 0.0, 0.0, 0.0, max(least, 0.0), max(middle, 0.0)
    long = math.sqrt(long)
    return nx / long, ny / long, nz / long, max(least, 0.0), max(middle, 0.0)

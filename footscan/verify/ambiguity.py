"""Ambiguity of a pose: directions in which a shape slides on itself, and evidence against another pose."""

import numpy as np
from numpy.typing import NDArray

from footscan.rows import distinct_rows
from footscan.verify.icp import Poses, fit_of, normal_equations, tukey_weights
from footscan.verify.nearest import Floats, Surface

PATCHES = 25
"""Patches along the diagonal of a shape; points in one patch share their errors. Chosen by hand."""


def stiffness(pose: Poses, points: Floats, surface: Surface, scale: float) -> tuple[float, Floats]:
    """Compute how firmly `surface` constrains one pose in the least constrained direction.

    Parameters
    ----------
    points : (N, 3) mm, centred at the origin
    scale : mm, of Tukey's biweight

    Returns
    -------
    The mean square distance by which the points over the surface leave it for a movement of 1 mm, and (6,) that
    movement: a rotation and a translation in the frame of the surface. A shape that slides on itself gives 0, a cube
    2/15. Gelfand et al., "Geometrically stable sampling for the ICP algorithm", 3DIM 2003.
    """
    fit = fit_of(pose, points, surface)
    weights = np.where(fit.within, tukey_weights(fit.distances, np.array([[scale]])), 0.0)
    placed = pose.place(points)
    middle = np.einsum("sn,sni->si", weights, placed) / max(float(weights.sum()), 1e-12)
    arms = placed - middle[:, None]
    arms /= np.sqrt(np.einsum("sn,sni,sni->", weights, arms, arms) / max(float(weights.sum()), 1e-12))
    normals = surface.nearest(placed[0]).normals[None]
    matrix, _ = normal_equations(arms, normals, np.zeros_like(arms), weights, 0.0)
    values, ways = np.linalg.eigh(matrix[0])
    return float(values[0]), ways[:, 0]


def evidence(best: Floats, other: Floats, patches: NDArray[np.integer]) -> float:
    """Standard deviations by which the squared distances `other`, (N,), are larger than `best`, (N,).

    If both poses were equally good, the sum of the differences in each patch would have a random sign.

    Examples
    --------
    Two patches with differences of 3 and 4:

    >>> evidence(np.zeros(3), np.array([1.0, 2.0, 4.0]), np.array([0, 0, 1]))
    1.4
    """
    sums = np.bincount(patches, weights=other - best)
    return float(sums.sum() / max(float(np.linalg.norm(sums)), 1e-300))


def patches_of(points: Floats) -> NDArray[np.intp]:
    """Returns (N,) the number of the patch in which each of (N, 3) `points` lies."""
    cell = float(np.linalg.norm(np.ptp(points, axis=0))) / PATCHES
    return distinct_rows(np.rint(points / cell).astype(np.int64)).number

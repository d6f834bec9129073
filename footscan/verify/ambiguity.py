"""Whether a pose is the only one: along which ways a shape slides on itself, and whether another pose is as good."""

import numpy as np
from numpy.typing import NDArray

from footscan.rows import distinct_rows
from footscan.verify.icp import Poses, fit_of, normal_equations, tukey_weights
from footscan.verify.nearest import Floats, Surface

PATCHES = 25
"""Patches along the diagonal of a shape: what is nearer to one another errs together."""


def stiffness(pose: Poses, points: Floats, surface: Surface, scale: float) -> tuple[float, Floats]:
    """How firmly `surface` holds one pose in the direction in which it holds it least.

    Parameters
    ----------
    points : (N, 3) mm, about their own middle
    scale : Tukey's, mm

    Returns
    -------
    The mean square by which points leave the surface for a movement of one mm, of the points that the surface lies
    under, and (6,) that movement: a turn and a shift in the frame of the surface. A shape that slides on itself gives
    0, a cube 2/15. Gelfand et al., "Geometrically stable sampling for the ICP algorithm", 3DIM 2003.
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
    """Standard deviations by which the squared distances `other` (N,) are larger than `best` (N,).

    Were both poses as good, the sum of the differences in each patch would have either sign by chance.
    """
    sums = np.bincount(patches, weights=other - best)
    return float(sums.sum() / max(float(np.linalg.norm(sums)), 1e-300))


def patches_of(points: Floats) -> NDArray[np.intp]:
    """(N,) number of the patch that each of (N, 3) `points` is in."""
    cell = float(np.linalg.norm(np.ptp(points, axis=0))) / PATCHES
    return distinct_rows(np.rint(points / cell).astype(np.int64)).number

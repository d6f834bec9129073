"""Homographies from the laser plane to the image, many at a time, to detect mistakes in a chart.

Residuals are in px, since the pixel is what a person clicks. A homography has so few unknowns that even five points
contradict it if one of them is wrong.
"""

from itertools import combinations, islice
from math import comb

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PASSED = 4
"""Number of points through which a homography always passes."""
UNKNOWNS = 8
"""Number of parameters of a homography."""
ROUNDS = 10
"""Gauss-Newton steps: a bound of time."""
LONGEST = 0.5
"""Bound of a step, in parameters of points of about unit size. Chosen by hand."""
PERSPECTIVE = 0.5
"""Prior standard deviation of a point's depth relative to that of the points' middle; usually 0.1 to 0.2. Chosen by
hand."""
DEPTHS = 3.0
"""Largest ratio of the distances of two points from their camera; 1.2 to 1.5 in the thesis. Chosen by hand."""
OBLIQUE = 7.0
"""Largest foreshortening of the plane; up to 3.2 in the thesis. Chosen by hand."""
SUBSETS = 120
"""Number of samples of four points: if a third of the points are wrong, one sample is correct but for 1 case in
10^11."""
TYPICAL = 5.0
"""Ratio of a point's distance to the typical one from which it disagrees. Chosen by hand."""
USUAL = 3.0
"""Ratio of a point's distance to the median one of a sample up to which it agrees with the sample. Chosen by hand."""
ROBUST_POINTS = 7
"""Number of points from which the others outvote a wrong one."""
RIDGE, HORIZON = 1e-9, 1e-9
"""Regularisation of normal equations; depth below which a point lies on the horizon: rounding."""
FAR, FAR_PX = 1e3, 1e9
"""Bounds of mapped points, in units of the points' size and in px: they stay finite."""


def fit_homographies(world: Floats, pixels: Floats) -> Floats:
    """Fit homographies with the least squared distances in px, by the Gauss-Newton method from the best affine map.

    A weak prior on the perspective keeps it plausible for points nearly on a line, which do not determine it.

    Parameters
    ----------
    world, pixels : (B, N, 2) float64, Y and Z in mm, and i and j in px; a leading dimension may be 1.

    Returns
    -------
    (B, 3, 3) float64, from mm to px.

    Examples
    --------
    >>> square = np.array([[[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]]])
    >>> homographies = fit_homographies(square, 2.0 * square + 100.0)
    >>> print(project(homographies, np.array([[[20.0, 10.0]]])).round(3))
    [[[140. 120.]]]
    """
    world, pixels = np.broadcast_arrays(world, pixels)
    plane, to_plane = _unit_size(world)
    image, to_image = _unit_size(pixels)
    x = np.concatenate([plane, np.ones((*plane.shape[:2], 1))], axis=2)
    precision = np.zeros((len(x), UNKNOWNS))
    precision[:, 6:] = (to_image[:, :1, 0] / PERSPECTIVE) ** 2  # for clicks with an error of 1 px
    affine = np.linalg.solve(x.transpose(0, 2, 1) @ x + RIDGE * np.eye(3), x.transpose(0, 2, 1) @ image)
    h = np.concatenate([affine.transpose(0, 2, 1).reshape(-1, 6), np.zeros((len(x), 2))], axis=1)
    best, least = h, np.full(len(h), np.inf)
    for _ in range(ROUNDS):
        depth = _away_from_zero(1.0 + np.einsum("bnk,bk->bn", x[:, :, :2], h[:, 6:]))[:, :, np.newaxis]
        seen = np.clip(np.einsum("bnk,bak->bna", x, h[:, :6].reshape(-1, 2, 3)) / depth, -FAR, FAR)
        missing = image - seen
        cost = np.sum(missing**2, axis=(1, 2)) + np.sum(precision * h**2, axis=1)
        best = np.where((cost < least)[:, np.newaxis], h, best)
        least = np.minimum(cost, least)
        over = np.clip(x / depth, -FAR, FAR)
        jacobian = np.zeros((*seen.shape, UNKNOWNS))
        jacobian[:, :, 0, 0:3] = over
        jacobian[:, :, 1, 3:6] = over
        jacobian[:, :, :, 6:8] = -seen[:, :, :, np.newaxis] * over[:, :, np.newaxis, :2]
        jacobian = jacobian.reshape(len(h), -1, UNKNOWNS)
        gradient = jacobian.transpose(0, 2, 1) @ missing.reshape(len(h), -1, 1) - (precision * h)[:, :, np.newaxis]
        normal = jacobian.transpose(0, 2, 1) @ jacobian + precision[:, :, np.newaxis] * np.eye(UNKNOWNS)
        normal += RIDGE * (1.0 + np.trace(normal, axis1=1, axis2=2))[:, np.newaxis, np.newaxis] * np.eye(UNKNOWNS)
        h = h + np.clip(np.linalg.solve(normal, gradient)[:, :, 0], -LONGEST, LONGEST)
    matrix = np.concatenate([best, np.ones((len(best), 1))], axis=1).reshape(-1, 3, 3)
    return np.asarray(np.linalg.inv(to_image) @ matrix @ to_plane)


def project(homographies: Floats, world: Floats) -> Floats:
    """Project points `world` (B, N, 2), mm, to pixels (B, N, 2), by `homographies` (B, 3, 3)."""
    points = world @ homographies[:, :, :2].transpose(0, 2, 1) + homographies[:, np.newaxis, :, 2]
    return np.clip(points[:, :, :2] / _away_from_zero(points[:, :, 2:]), -FAR_PX, FAR_PX)


def plausible(homographies: Floats, world: Floats) -> NDArray[np.bool_]:
    """Select the homographies (B, 3, 3) that a camera can have that sees `world` (B, N, 2), mm; (B,).

    All points lie in front of the camera, at similar distances, and the plane is not seen edge-on.
    """
    depth = np.einsum("bnk,bk->bn", world, homographies[:, 2, :2]) + homographies[:, 2, 2:]
    nearest, farthest = np.abs(depth).min(axis=1), np.abs(depth).max(axis=1)
    one_side = (depth > 0).all(axis=1) | (depth < 0).all(axis=1)
    moved = project(homographies, world)[:, :, :, np.newaxis] * homographies[:, np.newaxis, 2:, :2]
    slope = (homographies[:, np.newaxis, :2, :2] - moved) / _away_from_zero(depth)[:, :, np.newaxis, np.newaxis]
    squares = np.sum(slope**2, axis=(2, 3))  # sum of the squared singular values; their product is the determinant
    product = np.abs(np.linalg.det(slope))
    oblique = (squares > (OBLIQUE + 1.0 / OBLIQUE) * product).any(axis=1)
    return np.asarray(one_side & (farthest < DEPTHS * nearest) & ~oblique)


def plausible_misfits(world: Floats, pixels: Floats) -> Floats:
    """Compute the roots (B,) of the summed squares of `misfits`, px; infinite for a view that no camera can have."""
    world, pixels = np.broadcast_arrays(world, pixels)
    homographies = fit_homographies(world, pixels)
    squares = np.sum((project(homographies, world) - pixels) ** 2, axis=(1, 2))
    return np.asarray(np.where(plausible(homographies, world), np.sqrt(squares), np.inf))


def misfits(world: Floats, pixels: Floats) -> Floats:
    """Compute the distances (B, N), px, of points (B, N, 2) from the homography that is fitted to all N of them."""
    world, pixels = np.broadcast_arrays(world, pixels)
    return np.asarray(np.linalg.norm(project(fit_homographies(world, pixels), world) - pixels, axis=2))


def agreeing(world: Floats, pixels: Floats, limit_px: float) -> NDArray[np.bool_]:
    """Select the points of one camera that agree on a homography.

    They agree to within `limit_px`, or a few times their median distance if that is larger. The method is least median
    of squares over samples of four points (P. J. Rousseeuw, "Least median of squares regression", Journal of the
    American Statistical Association 79, 1984, 871-880, doi:10.1080/01621459.1984.10477105). All points are selected if
    they are too few to outvote one.

    Parameters
    ----------
    world, pixels : (N, 2) float64, mm and px.

    Returns
    -------
    (N,) bool.
    """
    count = len(world)
    if count < ROBUST_POINTS:
        return np.ones(count, np.bool_)
    fours = samples(count)
    homographies = fit_homographies(world[fours], pixels[fours])
    distances = np.linalg.norm(project(homographies, world[np.newaxis]) - pixels, axis=2)
    enough = (count + PASSED + 1) // 2
    usual = np.sort(distances, axis=1)[:, enough - 1]
    best = int(usual.argmin())
    agree: NDArray[np.bool_] = distances[best] <= max(limit_px, USUAL * float(usual[best]))
    for _ in range(2):  # the points of the sample have errors too: the fit to all that agree is better
        distance = _from_those(agree, world, pixels)
        typical = np.sqrt(np.sum(distance[agree] ** 2) / max(agree.sum() - PASSED, 1))
        agree = distance <= max(limit_px, TYPICAL * typical)
    return agree


def _from_those(agree: NDArray[np.bool_], world: Floats, pixels: Floats) -> Floats:
    """Distances (N,), px, of the points that agree; for each other point, the misfit that it adds if it joins them.

    A point whose place the others hardly determine adds less than its distance from there.
    """
    distance = np.zeros(len(world))
    [distance[agree]] = misfits(world[np.newaxis, agree], pixels[np.newaxis, agree])
    before = np.sum(distance**2)
    for point in np.flatnonzero(~agree):
        joined = agree | (np.arange(len(agree)) == point)
        squares = np.sum(misfits(world[np.newaxis, joined], pixels[np.newaxis, joined]) ** 2)
        distance[point] = np.sqrt(max(squares - before, 0.0))
    return distance


def sees_mirrored(homography: Floats, world: Floats) -> bool:
    """True if a camera sees the plane mirrored: as from +X, with Y to the right and Z up, while j points down.

    `homography` is (3, 3), from mm to px; `world` (N, 2), mm.
    """
    depth = world @ homography[2, :2] + homography[2, 2]
    return bool(np.linalg.det(homography) * np.median(np.sign(depth)) > 0)


def samples(count: int) -> NDArray[np.intp]:
    """Draw samples (S, 4) of the indices of `count` points: all of them if they are few, else random, with fixed seed.

    >>> print(samples(5))
    [[0 1 2 3]
     [0 1 2 4]
     [0 1 3 4]
     [0 2 3 4]
     [1 2 3 4]]
    """
    if comb(count, PASSED) <= SUBSETS:
        return np.array(list(islice(combinations(range(count), PASSED), SUBSETS)), np.intp)
    random = np.random.default_rng(count)
    return np.array([random.choice(count, PASSED, replace=False) for _ in range(SUBSETS)], np.intp)


def _unit_size(points: Floats) -> tuple[Floats, Floats]:
    """Points (B, N, 2) moved to zero and scaled to about unit size, and the matrices (B, 3, 3) that do so."""
    middle = points.mean(axis=1)
    centred = points - middle[:, np.newaxis]
    size = np.sqrt(np.mean(np.sum(centred**2, axis=2), axis=1))
    size = np.where(size > HORIZON, size, 1.0)
    matrices = np.zeros((len(points), 3, 3))
    matrices[:, 0, 0] = matrices[:, 1, 1] = 1.0 / size
    matrices[:, :2, 2] = -middle / size[:, np.newaxis]
    matrices[:, 2, 2] = 1.0
    return centred / size[:, np.newaxis, np.newaxis], matrices


def _away_from_zero(values: Floats) -> Floats:
    """The values, with `HORIZON` in place of smaller ones."""
    return np.where(np.abs(values) < HORIZON, HORIZON, values)

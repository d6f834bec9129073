"""Homographies from a laser's plane to the image, many at a time: what tells a mistake in a chart.

Residuals are in px here, since it is the pixel that a person clicks; and a homography has so few unknowns that even
five points contradict it when one of them is wrong.
"""

from itertools import combinations, islice
from math import comb

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PASSED = 4
"""A homography passes through so many points, whatever they are."""
UNKNOWNS = 8
ROUNDS = 10
LONGEST = 0.5
"""No step goes farther, in parameters of points of about unit size."""
PERSPECTIVE = 0.5
"""How much the depth of a point differs from that of the points' middle, relative to it: usually by 0.1 to 0.2."""
DEPTHS = 3.0
"""No point is so many times as far from its camera as another: 1.2 to 1.5 times in the thesis."""
OBLIQUE = 7.0
"""No plane is seen so many times shorter than it is: up to 3.2 times in the thesis."""
SUBSETS = 120
"""So many samples of four points have one without a mistake among a third of mistakes, but for 1 case in 10^11."""
TYPICAL = 5.0
"""A point disagrees that is so many times as far off as is typical."""
ROBUST_POINTS = 7
"""Fewer points cannot outvote a wrong one."""


def fit_homographies(world: Floats, pixels: Floats) -> Floats:
    """The homographies (B, 3, 3) with the least squared distances in px from `world` (B, N, 2), mm, to `pixels` alike.

    By the method of Gauss and Newton, from the best affine map. The perspective is held weakly to what a camera has, so
    that points nearly on a line leave it undetermined rather than absurd.
    """
    world, pixels = np.broadcast_arrays(world, pixels)
    plane, to_plane = _unit_size(world)
    image, to_image = _unit_size(pixels)
    x = np.concatenate([plane, np.ones((*plane.shape[:2], 1))], axis=2)
    precision = np.zeros((len(x), UNKNOWNS))
    precision[:, 6:] = (to_image[:, :1, 0] / PERSPECTIVE) ** 2  # of a click that errs by 1 px
    affine = np.linalg.solve(x.transpose(0, 2, 1) @ x + 1e-9 * np.eye(3), x.transpose(0, 2, 1) @ image)
    h = np.concatenate([affine.transpose(0, 2, 1).reshape(-1, 6), np.zeros((len(x), 2))], axis=1)
    best, least = h, np.full(len(h), np.inf)
    for _ in range(ROUNDS):
        depth = _away_from_zero(1.0 + np.einsum("bnk,bk->bn", x[:, :, :2], h[:, 6:]))[:, :, np.newaxis]
        seen = np.clip(np.einsum("bnk,bak->bna", x, h[:, :6].reshape(-1, 2, 3)) / depth, -1e3, 1e3)
        missing = image - seen
        cost = np.sum(missing**2, axis=(1, 2)) + np.sum(precision * h**2, axis=1)
        best = np.where((cost < least)[:, np.newaxis], h, best)
        least = np.minimum(cost, least)
        over = np.clip(x / depth, -1e3, 1e3)
        jacobian = np.zeros((*seen.shape, UNKNOWNS))
        jacobian[:, :, 0, 0:3] = over
        jacobian[:, :, 1, 3:6] = over
        jacobian[:, :, :, 6:8] = -seen[:, :, :, np.newaxis] * over[:, :, np.newaxis, :2]
        jacobian = jacobian.reshape(len(h), -1, UNKNOWNS)
        gradient = jacobian.transpose(0, 2, 1) @ missing.reshape(len(h), -1, 1) - (precision * h)[:, :, np.newaxis]
        normal = jacobian.transpose(0, 2, 1) @ jacobian + precision[:, :, np.newaxis] * np.eye(UNKNOWNS)
        normal += 1e-9 * (1.0 + np.trace(normal, axis1=1, axis2=2))[:, np.newaxis, np.newaxis] * np.eye(UNKNOWNS)
        h = h + np.clip(np.linalg.solve(normal, gradient)[:, :, 0], -LONGEST, LONGEST)
    matrix = np.concatenate([best, np.ones((len(best), 1))], axis=1).reshape(-1, 3, 3)
    return np.asarray(np.linalg.inv(to_image) @ matrix @ to_plane)


def project(homographies: Floats, world: Floats) -> Floats:
    """Pixels (B, N, 2) of `world` (B, N, 2), mm."""
    points = world @ homographies[:, :, :2].transpose(0, 2, 1) + homographies[:, np.newaxis, :, 2]
    return np.clip(points[:, :, :2] / _away_from_zero(points[:, :, 2:]), -1e9, 1e9)


def plausible(homographies: Floats, world: Floats) -> NDArray[np.bool_]:
    """Which of B homographies a camera can have that sees `world` (B, N, 2): (B,).

    All points lie before it, none much farther from it than another, and none on a plane that it sees edge-on.
    """
    depth = np.einsum("bnk,bk->bn", world, homographies[:, 2, :2]) + homographies[:, 2, 2:]
    nearest, farthest = np.abs(depth).min(axis=1), np.abs(depth).max(axis=1)
    one_side = (depth > 0).all(axis=1) | (depth < 0).all(axis=1)
    moved = project(homographies, world)[:, :, :, np.newaxis] * homographies[:, np.newaxis, 2:, :2]
    slope = (homographies[:, np.newaxis, :2, :2] - moved) / _away_from_zero(depth)[:, :, np.newaxis, np.newaxis]
    squares = np.sum(slope**2, axis=(2, 3))  # of the singular values, whose product is the determinant
    product = np.abs(np.linalg.det(slope))
    oblique = (squares > (OBLIQUE + 1.0 / OBLIQUE) * product).any(axis=1)
    return np.asarray(one_side & (farthest < DEPTHS * nearest) & ~oblique)


def plausible_misfits(world: Floats, pixels: Floats) -> Floats:
    """Roots (B,) of the summed squares of `misfits`, px; infinite where no camera can see the points so."""
    world, pixels = np.broadcast_arrays(world, pixels)
    homographies = fit_homographies(world, pixels)
    squares = np.sum((project(homographies, world) - pixels) ** 2, axis=(1, 2))
    return np.asarray(np.where(plausible(homographies, world), np.sqrt(squares), np.inf))


def misfits(world: Floats, pixels: Floats) -> Floats:
    """Distances (B, N), px, of points from the homography that is fitted to all N of them."""
    world, pixels = np.broadcast_arrays(world, pixels)
    return np.asarray(np.linalg.norm(project(fit_homographies(world, pixels), world) - pixels, axis=2))


def agreeing(world: Floats, pixels: Floats, limit_px: float) -> NDArray[np.bool_]:
    """Which points (N,) of one camera agree on a homography, to within `limit_px` or a few times their usual distance.

    Least median of squares over samples of four points (P. J. Rousseeuw, "Least median of squares regression", J. Am.
    Stat. Assoc. 79 (1984) 871-880); all points where they are too few to outvote one.
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
    agree: NDArray[np.bool_] = distances[best] <= max(limit_px, 3.0 * float(usual[best]))
    for _ in range(2):  # the sample's own points erred, too: all that agree with it say it better
        distance = _from_those(agree, world, pixels)
        typical = np.sqrt(np.sum(distance[agree] ** 2) / max(agree.sum() - PASSED, 1))
        agree = distance <= max(limit_px, TYPICAL * typical)
    return agree


def _from_those(agree: NDArray[np.bool_], world: Floats, pixels: Floats) -> Floats:
    """The distance (N,), px, of points that agree; of each other one what it adds to their misfit when it joins them.

    Where the others do not say well where a point belongs, it adds less than its distance from there.
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
    """Whether the way round in the image, j downwards, is that in the plane seen from +X, Y to the right, Z up."""
    depth = world @ homography[2, :2] + homography[2, 2]
    return bool(np.linalg.det(homography) * np.median(np.sign(depth)) > 0)


def samples(count: int) -> NDArray[np.intp]:
    """(S, 4) indices of `count` points: all fours where they are few, else always the same random ones."""
    if comb(count, PASSED) <= SUBSETS:
        return np.array(list(islice(combinations(range(count), PASSED), SUBSETS)), np.intp)
    random = np.random.default_rng(count)
    return np.array([random.choice(count, PASSED, replace=False) for _ in range(SUBSETS)], np.intp)


def _unit_size(points: Floats) -> tuple[Floats, Floats]:
    """Points (B, N, 2) about zero and of about unit size, and the matrices (B, 3, 3) that bring them there."""
    middle = points.mean(axis=1)
    centred = points - middle[:, np.newaxis]
    size = np.sqrt(np.mean(np.sum(centred**2, axis=2), axis=1))
    size = np.where(size > 1e-9, size, 1.0)
    matrices = np.zeros((len(points), 3, 3))
    matrices[:, 0, 0] = matrices[:, 1, 1] = 1.0 / size
    matrices[:, :2, 2] = -middle / size[:, np.newaxis]
    matrices[:, 2, 2] = 1.0
    return centred / size[:, np.newaxis, np.newaxis], matrices


def _away_from_zero(values: Floats) -> Floats:
    return np.where(np.abs(values) < 1e-9, 1e-9, values)

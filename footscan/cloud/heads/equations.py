"""The places of the heads by least squares, with small motions of the cameras and of the foot as nuisance."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from footscan.cloud.fusion.stripes import Floats
from footscan.cloud.heads.comparisons import HEAD_TERMS, RIGID, Comparisons, Ints
from footscan.robust import MAD_TO_SD, huber_weights, tukey_weights

PRIOR_SD = np.array([3.0, 0.03, 0.03, 0.01])
"""Standard deviations of offset, mm, yaw, pitch and scale of a head that was assembled at home. Chosen by hand."""
CAMERA_MM = 0.02
"""Error of a camera's map, mm. A camera that was knocked is moved by much more, but that is rare: the distribution has
long tails. Chosen by hand."""
FOOT_MM = 1.0
"""Standard deviation of the way, in Y and in Z, that a foot moves between the passes of two heads. Chosen by hand."""
INDEPENDENT = 0.02
"""Weight of a comparison: errors of neighbouring points are correlated, 50 of them count as one. Chosen by hand."""
GAUGE = 1e-3
"""Common places of all heads cannot be seen: the mean of each number is 0, to within this part of its standard
deviation."""
SHIFTS = 2
"""Numbers of a motion of the foot: those of a camera's motion without the turn."""
FAR = 4.0
"""Standard deviations beyond which an origin explains nothing. Chosen by hand."""
FEWEST_IN_STRETCH = 40
"""Comparisons of two heads on a stretch of the travel that show where a head is there. Chosen by hand."""
CONVERGING, REJECTING = 3, 2
"""Iterations of the robust least squares, with the weights of Huber and of Tukey: a bound of time."""


class HeadFit(NamedTuple):
    """Places of H heads and motions of C cameras."""

    places: Floats
    """(H, 4) offset in mm, yaw, pitch, scale"""
    sd: Floats
    """(H, 4)"""
    motions: Floats
    """(C, 3) mm"""
    shifts: Floats
    """(H, 2) of all cameras of a head in Y and Z, mm: the foot has moved between the passes of two heads"""
    spread_mm: float
    """Robust standard deviation of what is left of the distances between cameras of two heads"""


class FoundPlaces(NamedTuple):
    """What explains the comparisons."""

    fit: HeadFit
    unmoved_mm: float
    """Robust standard deviation of the distances between cameras of two heads with the heads as calibrated; cameras are
    moved all the same"""
    strays_mm: float = 0.0
    """As of `strays`"""


def unmoved_heads(known: Floats, cameras: int) -> HeadFit:
    """A fit with the heads at places (H, 4), to begin with."""
    return HeadFit(known, np.zeros(known.shape), np.zeros((cameras, RIGID)), np.zeros((len(known), SHIFTS)), 0.0)


def same_line(comparisons: Comparisons, laser: Ints, heads: int) -> Floats:
    """Derivatives (M, H) of the distance by X of each head, if both cameras saw the line of head `laser` (M,).

    Each camera maps the line as if it lay in the plane of its own head, and so displaces it along its sight.
    """
    rows, (own, other) = np.arange(len(laser)), comparisons.along_sight.T
    change = np.zeros((len(laser), heads))
    np.add.at(change, (rows, laser), own - other)
    np.add.at(change, (rows, comparisons.heads[:, 1]), other)
    np.add.at(change, (rows, comparisons.heads[:, 0]), -own)
    return change


def own_lines(comparisons: Comparisons, heads: int) -> Floats:
    """The same if each camera saw the line of its own head: on skin that slopes along X."""
    rows, slope = np.arange(len(comparisons.slope)), np.nan_to_num(comparisons.slope)
    change = np.zeros((len(slope), heads))
    np.add.at(change, (rows, comparisons.heads[:, 1]), slope)
    np.add.at(change, (rows, comparisons.heads[:, 0]), -slope)
    return change


def merged_lines(comparisons: Comparisons, heads: int) -> Floats:
    """The same if both cameras saw one line, in the middle between those of their two heads."""
    first, second = (same_line(comparisons, comparisons.heads[:, k], heads) for k in (0, 1))
    return np.asarray((first + second) / 2)


def likeliest(comparisons: Comparisons, origins: list[Floats], distance: Floats, fit: HeadFit) -> Floats:
    """Derivatives (M, H) of the likeliest origin: that which explains `distance` (M,) best by the places of a fit.

    origins : (M, H) each, as of `same_line`. What one pair of cameras sees on a stretch of the travel has one origin:
    where both lasers reach the skin, one of them is brighter as a rule.
    """
    rest = distance - motions_seen(comparisons, fit)
    left = np.array([rest - displacements(change, comparisons, fit.places) for change in origins])
    costs = np.minimum(left**2 / comparisons.variance, FAR**2)
    group = groups_of(comparisons)
    best = np.argmin([np.bincount(group, cost) for cost in costs], axis=0)
    return np.asarray(np.choose(best[group][:, None], origins))


def groups_of(comparisons: Comparisons) -> Ints:
    """(M,) numbers of what one pair of cameras sees on one stretch of the travel."""
    first, second = comparisons.cameras.T
    one_row = np.stack([np.minimum(first, second), np.maximum(first, second), comparisons.stretch])
    one_row -= one_row.min(axis=1, keepdims=True, initial=0)
    numbers = np.ravel_multi_index(tuple(one_row), tuple(one_row.max(axis=1, initial=0) + 1))
    return np.asarray(np.unique(numbers, return_inverse=True)[1], np.intp)


def displacements(change: Floats, comparisons: Comparisons, places: Floats) -> Floats:
    """(M,) distances that places (H, 4) of the heads explain, mm."""
    return np.asarray(np.einsum("mh,mh->m", change, comparisons.terms @ places.T))


def motions_seen(comparisons: Comparisons, fit: HeadFit) -> Floats:
    """(M,) distances that the motions of the cameras and of the foot explain, mm."""
    apart = fit.motions[comparisons.cameras[:, 0]] - fit.motions[comparisons.cameras[:, 1]]
    apart[:, :SHIFTS] += fit.shifts[comparisons.heads[:, 0]] - fit.shifts[comparisons.heads[:, 1]]
    return np.asarray(np.einsum("mt,mt->m", comparisons.rigid, apart))


def solve(comparisons: Comparisons, change: Floats, distance: Floats, near: HeadFit) -> HeadFit:
    """Solve for the places by which `distance` (M,) is explained, with robust weights.

    change : (M, H), of `same_line` and its like
    near : a fit by whose residuals the first weights are
    """
    heads, cameras = change.shape[1], len(near.motions)
    rows = _rows(comparisons, change, cameras)
    known = _priors(heads, near.motions)
    noise = np.sqrt(comparisons.variance)
    unknowns = np.concatenate([near.places.ravel(), near.motions.ravel(), near.shifts.ravel()])
    of_heads, of_cameras = HEAD_TERMS * heads, HEAD_TERMS * heads + RIGID * cameras
    weights, normal = np.zeros(len(noise)), known
    for weigh in (*[huber_weights] * CONVERGING, *[tukey_weights] * REJECTING):
        left = np.abs(distance - rows @ unknowns) / noise
        scale = max(1.0, MAD_TO_SD * float(np.median(left)) if len(left) else 1.0)
        weights = INDEPENDENT * weigh(left / scale) / (scale * noise) ** 2
        known = _priors(heads, unknowns[of_heads:of_cameras].reshape(cameras, RIGID))
        root = np.sqrt(weights)
        weighted = rows * root[:, None]
        normal = weighted.T @ weighted + known
        unknowns = np.linalg.solve(normal, weighted.T @ (root * distance))
    left = distance - rows @ unknowns
    sd = _deviations(comparisons, rows * (weights * left)[:, None], normal, known)
    return HeadFit(
        unknowns[:of_heads].reshape(heads, HEAD_TERMS),
        sd[:of_heads].reshape(heads, HEAD_TERMS),
        unknowns[of_heads:of_cameras].reshape(cameras, RIGID),
        unknowns[of_cameras:].reshape(heads, SHIFTS),
        spread_of(left[comparisons.is_across]),
    )


def spread_unmoved(comparisons: Comparisons, change: Floats, distance: Floats, known: Floats, cameras: int) -> float:
    """Robust standard deviation, mm, of what is left of `distance` (M,) with the heads at the places (H, 4) known."""
    rest = distance - displacements(change, comparisons, known)
    still = unmoved_heads(np.zeros(known.shape), cameras)
    return solve(comparisons, np.zeros(change.shape), rest, still).spread_mm


def strays(comparisons: Comparisons, change: Floats, distance: Floats, fit: HeadFit) -> float:
    """How far a head strays from its place in the fit, from one stretch of the travel to the next, mm.

    It is the root mean square over stretches of the offset that explains best what the fit leaves of `distance` (M,),
    of the head for which it is largest; 0 without comparisons of two heads.
    """
    left = distance - motions_seen(comparisons, fit) - displacements(change, comparisons, fit.places)
    noise, heads = np.sqrt(comparisons.variance), change.shape[1]
    known = PRIOR_SD[0] ** -2.0 * np.eye(heads) + (GAUGE * PRIOR_SD[0]) ** -2.0 * np.ones((heads, heads))
    offsets = []
    for stretch in np.unique(comparisons.stretch[comparisons.is_across]):
        here = comparisons.is_across & (comparisons.stretch == stretch)
        if np.count_nonzero(here) < FEWEST_IN_STRETCH:
            continue
        rows, offset = change[here], np.zeros(heads)
        for _ in range(CONVERGING):
            apart = np.abs(left[here] - rows @ offset) / noise[here]
            scale = max(1.0, MAD_TO_SD * float(np.median(apart)))
            weighted = rows.T * (INDEPENDENT * huber_weights(apart / scale) / (scale * noise[here]) ** 2)
            offset = np.linalg.solve(weighted @ rows + known, weighted @ left[here])
        offsets.append(offset)
    return float(np.sqrt(np.mean(np.square(offsets), axis=0)).max()) if offsets else 0.0


def spread_of(distances: Floats) -> float:
    """Robust standard deviation of distances (N,) from zero, mm; 0 without any.

    >>> spread_of(np.array([-1.0, 1.0, 1.0]))
    1.4826
    """
    return MAD_TO_SD * float(np.median(np.abs(distances))) if len(distances) else 0.0


def _rows(comparisons: Comparisons, change: Floats, cameras: int) -> Floats:
    """(M, 4 H + 3 C + 2 H) derivatives of what the unknowns explain of the distances."""
    heads = change.shape[1]
    of_cameras = np.zeros((len(change), cameras, RIGID))
    number = np.arange(len(change))
    of_cameras[number, comparisons.cameras[:, 0]] += comparisons.rigid
    of_cameras[number, comparisons.cameras[:, 1]] -= comparisons.rigid
    of_foot = np.zeros((len(change), heads, SHIFTS))
    of_foot[number, comparisons.heads[:, 0]] += comparisons.rigid[:, :SHIFTS]
    of_foot[number, comparisons.heads[:, 1]] -= comparisons.rigid[:, :SHIFTS]
    of_heads = change[:, :, None] * comparisons.terms[:, None, :]
    return np.hstack([columns.reshape(len(change), -1) for columns in (of_heads, of_cameras, of_foot)])


def _priors(heads: int, motions: Floats) -> Floats:
    """Precision of the unknowns before the scan; of a camera that moves by (3,) of `motions`, by Cauchy's weight."""
    of_cameras = np.hypot(CAMERA_MM, np.linalg.norm(motions, axis=1))
    sd = np.concatenate([np.tile(PRIOR_SD, heads), np.repeat(of_cameras, RIGID), np.full(SHIFTS * heads, FOOT_MM)])
    precision = np.diag(sd**-2.0)
    for k in range(HEAD_TERMS):
        of_all = np.zeros(len(sd))
        of_all[k : HEAD_TERMS * heads : HEAD_TERMS] = 1.0 / (GAUGE * PRIOR_SD[k])
        precision += np.outer(of_all, of_all)
    return precision


def _deviations(comparisons: Comparisons, errors: Floats, normal: Floats, known: Floats) -> Floats:
    """Standard deviations of the unknowns; comparisons of two cameras on one stretch of the travel err together.

    K.-Y. Liang and S. L. Zeger, Biometrika 73(1), 1986, doi:10.1093/biomet/73.1.13.
    """
    group = groups_of(comparisons)
    groups = int(group.max()) + 1 if len(group) else 0
    sums = csr_array((np.ones(len(group)), (group, np.arange(len(group)))), (groups, len(group))) @ errors
    scatter = (sums.T @ sums) * groups / max(groups - errors.shape[1], 1) + known
    inverse = np.linalg.inv(normal)
    return np.sqrt(np.diag(inverse @ scatter @ inverse))

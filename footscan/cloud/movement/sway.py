"""Slow movement of the foot, from heads that film the same skin at different times.

One camera cannot tell a foot that sways, at 0.2 to 1 Hz (D. A. Winter, Gait & Posture 3(4), 1995), from another foot.
The laser planes of two heads mostly lie some millimetres apart along the travel, so that the second one passes a place
of the skin some frames after the first. The distance between the stripes there is what the foot has moved meanwhile.
Heads whose planes coincide show nothing.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from footscan.cloud.fusion.agreement import find_overlaps
from footscan.cloud.fusion.stripes import Floats, Stripes
from footscan.cloud.movement.tremor import LEAST_MM, STEEPEST, chord_beside
from footscan.robust import MAD_TO_SD, cauchy_weights

Ints = NDArray[np.intp]

REACH_MM = 2.0
"""Largest distance between the stripes of two heads. Chosen by hand."""
CENTRE = np.array([0.0, 50.0])
"""Y and Z, mm, about which heads are turned: the middle of the scan volume."""
TURN_MM = 50.0
"""Distance from there at which a turn is counted in mm."""
COURSE_FRAMES, LEAST_SHARE = 8.0, 1e-4
"""Frames over which the foot stays about where it is: a sway at 0.5 Hz turns by a radian and a half in 8 frames at 18
frames a second. Courses that have less than this share of the variance of the greatest one are left out. Chosen by
hand."""
APART_MM = 1.0
"""Standard deviation of what the heads of a pair are apart. Chosen by hand."""
SHOWS = 0.2
"""Independent comparisons that a stripe and another camera make up: errors of neighbouring points, and of the maps of
both cameras, are correlated. Chosen by hand, after two scanners (`draw_assembled`, seeds 501 and 502 with films)."""
FEWEST = 200
"""Comparisons that show a movement."""
LEAST_LAG_FRAMES = 0.5
"""Frames between two heads at the same skin, root mean square, in which a foot moves enough to be seen: one that sways
by 0.1 mm moves by 0.01 mm, which is less than the maps of the cameras differ by. Chosen by hand."""
ROUNDS = 8
"""Iterations of the reweighted least squares: a bound of time."""
SIZES_MM = 0.05 * 2.0 ** np.arange(6)
"""Standard deviations of the movement along an axis that are tried: those of a foot that stands on glass, to those of
one that steps."""
RARER = 3.0
"""A size is rarer than half of it by two to the power of this: without any comparison 0.07 mm are expected. Chosen by
hand."""


def sway_of(stripes: Stripes, heads: Mapping[int, int]) -> tuple[float, float] | None:
    """Estimate the standard deviations of the slow movement of a foot, along X and Y, mm.

    They are root mean squares over the probability of each size, given the comparisons; where these show little, the
    size is that of most feet. What a head that is shifted or turned as a whole adds to the distances is estimated along
    with the movement, for each pair of heads.

    Parameters
    ----------
    stripes : of all cameras, without outliers, mm, scanner frame
    heads : camera -> number of its head; frames of all heads with one number are of one moment

    Returns
    -------
    None where heads hardly see the same skin, or all see it at the same moment
    """
    contradictions = _contradictions(stripes, heads)
    if len(contradictions.distance) < FEWEST or contradictions.lag_frames < LEAST_LAG_FRAMES:
        return None
    change, courses = _change(contradictions)
    shows = SHOWS * contradictions.stripes / len(contradictions.distance)
    normal, right = _normal_equations(change, contradictions.distance, shows, _prior(change, courses, (1.0, 1.0)))
    sizes = np.stack(np.meshgrid(SIZES_MM, SIZES_MM, indexing="ij"), axis=-1).reshape(-1, 2)
    likely = np.array([_log_evidence(normal, right, _prior(change, courses, size)) for size in sizes])
    likely -= RARER * np.log(sizes).sum(axis=1)
    weights = np.exp(likely - likely.max())
    x, y = np.sqrt(weights @ sizes**2 / weights.sum())
    return float(x), float(y)


class _Contradictions(NamedTuple):
    """M points of one head, beside the stripe of another head in the same plane."""

    distance: Floats
    """(M,) from the point to that stripe along the normal of the point, mm"""
    change: Floats
    """(M, 2) derivatives of that by a movement of the other stripe in X and Y"""
    across: Floats
    """(M, 2) derivatives by its movement in Z, and by its turn about X, mm at `TURN_MM`"""
    frames: Floats
    """(M, 2) frames in which the point and the other stripe were filmed"""
    pair: Ints
    """(M,) number of the pair of heads"""
    way: Floats
    """(M,) 1 if the other head has the larger number, or -1"""
    stripes: int
    """Number of stripes of one camera that were compared with another camera"""

    @property
    def lag_frames(self) -> float:
        """Frames between the point and the other stripe, root mean square."""
        return float(np.sqrt(np.mean(np.diff(self.frames) ** 2)))


def _contradictions(stripes: Stripes, heads: Mapping[int, int]) -> _Contradictions:
    overlaps = find_overlaps(stripes, stripes.yz, REACH_MM)
    head_of = np.array([heads.get(int(camera), 0) for camera in stripes.cameras], np.intp)
    own, other = head_of[stripes.camera[overlaps.point]], head_of[overlaps.other]
    between = np.flatnonzero((own > 0) & (other > 0) & (own != other))
    _, slope = chord_beside(stripes, overlaps.point[between])
    good = np.abs(slope) < STEEPEST  # false for NaN
    between, slope = between[good], slope[good]
    point, own, other = overlaps.point[between], own[between], other[between]
    normals, away = stripes.normals[point], (stripes.yz[point] - CENTRE) / TURN_MM
    frame, plane = stripes.points["frame"].astype(np.float64), stripes.points["plane"].astype(np.float64)
    frames = np.column_stack([frame[point], np.zeros(len(point))])
    for head in np.unique(other):
        of_head, asked = head_of[stripes.camera] == head, other == head
        frames[asked, 1] = _frames_at(plane[point[asked]], plane[of_head], frame[of_head])
    return _Contradictions(
        distance=overlaps.distance[between],
        change=np.column_stack([-slope, normals[:, 0]]),
        across=np.column_stack([normals[:, 1], normals[:, 1] * away[:, 0] - normals[:, 0] * away[:, 1]]),
        frames=frames,
        pair=np.unique(np.sort(np.column_stack([own, other])), axis=0, return_inverse=True)[1].reshape(-1),
        way=np.where(own < other, 1.0, -1.0),
        stripes=len(np.unique(np.column_stack([stripes.camera[point], overlaps.other[between], frame[point]]), axis=0)),
    )


def _frames_at(x: Floats, plane: Floats, frame: Floats) -> Floats:
    """(M,) frames in which a head was at `x` (M,) mm, from the planes (N,) of its points and their frames (N,)."""
    frames, number = np.unique(frame, return_inverse=True)
    planes = np.bincount(number, plane) / np.bincount(number)
    order = np.argsort(planes)
    return np.asarray(np.interp(x, planes[order], frames[order]))


def _change(contradictions: _Contradictions) -> tuple[Floats, int]:
    """Derivatives (M, 2 C + 4 P) of the distances by C courses of the foot along X, by as many along Y, and by the
    shift in X, Y and Z and the turn between the heads of P pairs; and C.

    The courses are the principal components of smooth movements, each with the standard deviation that it has.
    """
    first = int(contradictions.frames.min())
    number = np.arange(int(contradictions.frames.max()) + 2 - first)
    alike = np.exp(-0.5 * ((number[:, None] - number) / COURSE_FRAMES) ** 2)
    variances, courses = np.linalg.eigh(alike)
    much = variances > LEAST_SHARE * variances[-1]
    courses = courses[:, much] * np.sqrt(variances[much])
    own, other = (_at(courses, frames - first) for frames in contradictions.frames.T)
    shifts = np.column_stack([contradictions.change, contradictions.across]) * contradictions.way[:, None]
    pairs = np.arange(contradictions.pair.max() + 1)
    of_pairs = [np.where((contradictions.pair == pair)[:, None], shifts, 0.0) for pair in pairs]
    moves = [change[:, None] * (other - own) for change in contradictions.change.T]
    return np.concatenate([*moves, *of_pairs], axis=1), courses.shape[1]


def _at(courses: Floats, frames: Floats) -> Floats:
    """(M, C) courses (F, C) at `frames` (M,), which may lie between two."""
    number = np.floor(frames).astype(np.intp)
    share = (frames - number)[:, None]
    return np.asarray((1.0 - share) * courses[number] + share * courses[number + 1])


def _prior(change: Floats, courses: int, sizes: Sequence[float] | Floats) -> Floats:
    """Inverse variances of all unknowns, for movements of `sizes` along X and Y, mm."""
    pairs = change.shape[1] - 2 * courses
    return np.repeat([*sizes, APART_MM], [courses, courses, pairs]) ** -2.0


def _normal_equations(change: Floats, distance: Floats, shows: float, prior: Floats) -> tuple[Floats, Floats]:
    """Matrix and right side of robust least squares, without the prior.

    `shows` : independent comparisons that each distance makes up
    """
    weights, spread = np.ones(len(distance)), LEAST_MM
    for _ in range(ROUNDS):
        weighted = change * (shows * weights / spread**2)[:, None]
        normal, right = weighted.T @ change, weighted.T @ distance
        left = np.abs(distance - change @ np.linalg.solve(normal + np.diag(prior), right))
        spread = max(MAD_TO_SD * float(np.median(left)), LEAST_MM)
        weights = cauchy_weights(left / spread)
    return normal, right


def _log_evidence(normal: Floats, right: Floats, prior: Floats) -> float:
    """Logarithm of the probability of the comparisons under a prior, but for a constant (C. M. Bishop, Pattern
    Recognition and Machine Learning, 2006, eq. 3.86)."""
    lower = np.linalg.cholesky(normal + np.diag(prior))
    explained = np.sum(solve_triangular(lower, right, lower=True) ** 2)
    return float(0.5 * (explained + np.log(prior).sum()) - np.log(np.diag(lower)).sum())

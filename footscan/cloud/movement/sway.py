"""Slow movement of the foot, from heads that film the same skin at different times.

One camera cannot tell a foot that sways, at 0.2 to 1 Hz (D. A. Winter, Gait & Posture 3(4), 1995), from another foot.
The laser planes of two heads mostly lie some millimetres apart along the travel, so that the second one passes a place
of the skin some frames after the first. The distance between the stripes there is what the foot has moved meanwhile.
Heads whose planes coincide show nothing.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from footscan.cloud.fusion.agreement import find_overlaps
from footscan.cloud.fusion.stripes import Floats, Stripes
from footscan.cloud.movement.pace import PACE_FRAMES
from footscan.cloud.movement.tremor import LEAST_MM, STEEPEST, chord_beside
from footscan.robust import MAD_TO_SD, cauchy_weights

Ints = NDArray[np.intp]

REACH_MM = 2.0
"""Largest distance between the stripes of two heads. Chosen by hand."""
CENTRE = np.array([0.0, 50.0])
"""Y and Z, mm, about which heads are turned: the middle of the scan volume."""
TURN_MM = 50.0
"""Distance from there at which a turn is counted in mm."""
PACES_FRAMES = np.geomspace(3.0, 10.0, 4)
"""Paces that are tried: those of movements at 1 to 0.3 Hz at 18 frames a second. What is slower looks like errors of
the cameras' maps, and hardly moves landmarks."""
LEAST_SHARE = 1e-4
"""Courses that have less than this share of the variance of the greatest one are left out. Chosen by hand."""
APART_MM = 1.0
"""Standard deviation of what the heads of a pair are apart. Chosen by hand."""
SHOWS_X = 0.2
"""Share of the evidence for a movement along X that counts: maps and planes of two heads that differ look like one,
since either displaces skin by its slope. Chosen by hand, after scanners with feet that stand still (`draw_assembled`,
seeds 6228 to 6233)."""
CLEAR, DOUBTFUL = 6.0, 1.3
"""Logarithm of the odds for a movement along Y, against the smallest size, from which the foot is moved back, and the
factor by which what is left is larger than it seems. Chosen by hand, after the same feet, also filmed, and 18 that sway
(`draw_moving`, seeds 7410 to 7449, 7523, 7525 and 7594): the logarithm for a still foot reaches 4, and the true slope
of what is left is 0.1 to 1.8 times the estimated one."""
FEWEST = 200
"""Comparisons that show a movement."""
LEAST_LAG_FRAMES = 0.5
"""Frames between two heads at the same skin, root mean square, in which a foot moves enough to be seen: one that sways
by 0.1 mm moves by 0.01 mm, which is less than the maps of the cameras differ by. Chosen by hand."""
ROUNDS = 6
"""Iterations of the reweighted least squares: a bound of time."""
SIZES_MM = 0.025 * 2.0 ** np.arange(7)
"""Standard deviations of the movement along an axis that are tried, at the usual pace, and at others with the same
slope: those of a foot that stands on glass, to those of one that steps."""
USUAL_MM, FACTOR = 0.07, 2.0
"""Sizes of most feet: log-normal about the first, with this factor as standard deviation. Chosen by hand."""


class Sway(NamedTuple):
    """The slow movement of a foot, along X and along Y."""

    sizes_mm: tuple[float, float]
    """Standard deviations"""
    y_mm: Floats
    """(F,) way along Y from the first frame of a scan on; empty if it is not clear"""
    left_x_mm: float
    """Standard deviation of a movement along X at the usual pace that has the same slope"""
    left_y_mm: Floats
    """(F,) standard deviations of what is left along Y when the foot was moved back"""
    left_y_frames: float
    """Its pace: a standard deviation of it, relative to that of its slope by frame"""


def sway_of(stripes: Stripes, heads: Mapping[int, int]) -> Sway | None:
    """Estimate the slow movement of a foot.

    Sizes are root mean squares over the probability of each size and pace, given the comparisons; where these show
    little, the size is that of most feet. What a head that is shifted or turned as a whole adds to the distances is
    estimated along with the movement, for each pair of heads.

    Parameters
    ----------
    stripes : of all cameras, without outliers, mm, scanner frame
    heads : camera -> number of its head; frames with one number are of one moment

    Returns
    -------
    None where heads hardly see the same skin, or all see it at the same moment
    """
    contradictions = _contradictions(stripes, heads)
    if len(contradictions.distance) < FEWEST or contradictions.lag_frames < LEAST_LAG_FRAMES:
        return None
    at_paces = [_at_pace(contradictions, pace) for pace in PACES_FRAMES]
    share_x = _probability(SHOWS_X * np.array([found.along_x for found in at_paces]))
    along_y = np.array([found.along_y for found in at_paces])
    share_y = _probability(along_y)
    # A movement that seems fast is not taken for a smaller one.
    at_pace = SIZES_MM * np.maximum(PACES_FRAMES[:, None] / PACE_FRAMES, 1.0)
    sizes = math.sqrt(np.sum(share_x * at_pace**2)), math.sqrt(np.sum(share_y * at_pace**2))
    of_pace = share_y.sum(axis=1)
    way = of_pace @ [found.way for found in at_paces]
    moments = np.tensordot(of_pace, [found.covariance + np.outer(found.way, found.way) for found in at_paces], 1)
    is_clear = along_y.max() > CLEAR
    if is_clear:
        moments -= np.outer(way, way)
    slope_mm = _deviations(moments, np.asarray(np.gradient(np.eye(len(way)), axis=0)))
    left_mm, pace = PACE_FRAMES * slope_mm, PACE_FRAMES
    if is_clear:
        # What is left drifts: each error of the slope moves all later frames against all earlier ones.
        compared = contradictions.frames.astype(np.intp)
        is_compared = np.isin(np.arange(len(way)), compared)
        left_mm = _deviations(moments, np.eye(len(way)) - is_compared / is_compared.sum())
        pace = math.sqrt(np.mean(left_mm[is_compared] ** 2) / np.mean(slope_mm[is_compared] ** 2))
    return Sway(
        sizes_mm=sizes,
        y_mm=way if is_clear else np.zeros(0),
        left_x_mm=math.sqrt(np.sum(share_x * SIZES_MM**2)),
        left_y_mm=DOUBTFUL * left_mm,
        left_y_frames=pace,
    )


def _deviations(moments: Floats, terms: Floats) -> Floats:
    """(T,) standard deviations of linear `terms` (T, F) of F values that have these second moments (F, F)."""
    return np.asarray(np.sqrt(np.einsum("ti,ij,tj->t", terms, moments, terms, optimize=True)))


class _AtPace(NamedTuple):
    """What S sizes of a movement at one pace, along X and along Y, explain in F frames."""

    along_x: Floats
    """(S,) logarithms of their odds against the smallest size"""
    along_y: Floats
    way: Floats
    """(F,) expected way along Y, mm"""
    covariance: Floats
    """(F, F) of that way, mm^2"""


def _at_pace(contradictions: "_Contradictions", pace: float) -> _AtPace:
    """Robust least squares for a movement at one pace, under all sizes."""
    courses = _courses(int(contradictions.frames.max()) + 2, pace)
    change, count = _change(contradictions, courses), courses.shape[1]
    # The points of a stripe err together: each stripe is one comparison with another camera.
    shows = contradictions.stripes / len(contradictions.distance)
    prior = _prior(change, count, (USUAL_MM, USUAL_MM))
    normal, right = _normal_equations(change, contradictions.distance, shows, prior)
    evidence = np.array(
        [[_log_evidence(normal, right, _prior(change, count, (x, y))) for y in SIZES_MM] for x in SIZES_MM]
    )
    along_x, along_y = logsumexp(evidence, axis=1), logsumexp(evidence, axis=0)
    sizes = _expected_mm(SHOWS_X * along_x), _expected_mm(along_y)
    covariance = np.asarray(np.linalg.inv(normal + np.diag(_prior(change, count, sizes))))
    of_y = slice(count, 2 * count)
    return _AtPace(
        along_x=along_x - along_x[0],
        along_y=along_y - along_y[0],
        way=courses @ (covariance @ right)[of_y],
        covariance=courses @ covariance[of_y, of_y] @ courses.T,
    )


def _expected_mm(evidence: Floats) -> float:
    """Root mean square of the sizes over their probability, given the logarithms (S,) of their evidence."""
    return math.sqrt(_probability(evidence) @ SIZES_MM**2)


def _probability(evidence: Floats) -> Floats:
    """Probabilities (..., S) of sizes by the logarithms of their evidence; their sum is 1."""
    likely = evidence - 0.5 * (np.log(SIZES_MM / USUAL_MM) / math.log(FACTOR)) ** 2
    return np.asarray(np.exp(likely - logsumexp(likely)))


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
    frames = np.column_stack([stripes.points["frame"][point].astype(np.float64), np.zeros(len(point))])
    for camera in np.unique(overlaps.other[between]):
        asked = overlaps.other[between] == camera
        frames[asked, 1] = _frames_at(stripes, point[asked], stripes.camera == camera)
    return _Contradictions(
        distance=overlaps.distance[between],
        change=np.column_stack([-slope, normals[:, 0]]),
        across=np.column_stack([normals[:, 1], normals[:, 1] * away[:, 0] - normals[:, 0] * away[:, 1]]),
        frames=frames,
        pair=np.unique(np.sort(np.column_stack([own, other])), axis=0, return_inverse=True)[1].reshape(-1),
        way=np.where(own < other, 1.0, -1.0),
        stripes=len(np.unique(np.column_stack([stripes.camera[point], overlaps.other[between], frames[:, 0]]), axis=0)),
    )


def _frames_at(stripes: Stripes, asked: Ints, of_camera: NDArray[np.bool_]) -> Floats:
    """(M,) frames in which a camera filmed the skin at the points `asked` (M,), between its own frames.

    Heads are turned against each other, so that a laser plane passes some of the skin earlier, and some later.
    """
    points = stripes.points.compress(of_camera)
    plane = points["plane"].astype(np.float64)
    # How far ahead of its middle a laser plane meets the skin is linear in Y and Z.
    terms, terms_asked = (np.insert(stripes.yz[rows], 0, 1.0, axis=1) for rows in (of_camera, asked))
    ahead = np.linalg.lstsq(terms, stripes.x[of_camera] - plane)[0]
    frames, number = np.unique(points["frame"], return_inverse=True)
    planes = np.bincount(number, plane) / np.bincount(number)
    order = np.argsort(planes)
    return np.asarray(np.interp(stripes.x[asked] - terms_asked @ ahead, planes[order], frames[order]))


def _courses(count: int, pace: float) -> Floats:
    """(F, C) principal components of movements at a pace in F frames, each with the standard deviation
    that it has if the slope is that of 1 mm at the usual pace."""
    number = np.arange(count)
    variances, courses = np.linalg.eigh(np.exp(-0.5 * ((number[:, None] - number) / pace) ** 2))
    much = variances > LEAST_SHARE * variances[-1]
    return np.asarray(courses[:, much] * np.sqrt(variances[much]) * pace / PACE_FRAMES)


def _change(contradictions: _Contradictions, courses: Floats) -> Floats:
    """Derivatives (M, 2 C + 4 P) of the distances by C courses (F, C) of the foot along X, by as many along Y, and by
    the shift in X, Y and Z and the turn between the heads of P pairs."""
    own, other = (_at(courses, frames) for frames in contradictions.frames.T)
    shifts = np.column_stack([contradictions.change, contradictions.across]) * contradictions.way[:, None]
    pairs = np.arange(contradictions.pair.max() + 1)
    of_pairs = [np.where((contradictions.pair == pair)[:, None], shifts, 0.0) for pair in pairs]
    moves = [change[:, None] * (other - own) for change in contradictions.change.T]
    return np.concatenate([*moves, *of_pairs], axis=1)


def _at(courses: Floats, frames: Floats) -> Floats:
    """(M, C) courses (F, C) at `frames` (M,), which may lie between two."""
    number = np.floor(frames).astype(np.intp)
    share = (frames - number)[:, None]
    return np.asarray((1.0 - share) * courses[number] + share * courses[number + 1])


def _prior(change: Floats, courses: int, sizes: tuple[float, float]) -> Floats:
    """Inverse variances of all unknowns, for movements of `sizes` along X and Y, mm."""
    pairs = change.shape[1] - 2 * courses
    return np.asarray(np.repeat([*sizes, APART_MM], [courses, courses, pairs]) ** -2.0)


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

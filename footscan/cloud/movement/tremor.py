"""Movement of the foot from frame to frame.

A foot trembles at 8 to 12 Hz (R. J. Elble, Journal of Clinical Neurophysiology 13(6), 1996), so that each stripe lies
elsewhere than those before and after it say. Skin is smooth over a few millimetres of the travel: what all stripes of a
frame have in common beside their neighbours is movement.
"""

from collections.abc import Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from footscan.cloud.fusion.agreement import GAP_STEPS
from footscan.cloud.fusion.stripes import Floats, Stripes, traces_of, ways_to_neighbours
from footscan.cloud.movement.passes import BETWEEN_PASSES
from footscan.cloud.points import stripe_step
from footscan.compiled import compiled
from footscan.robust import MAD_TO_SD, cauchy_weights, huber_weights
from schemas.movement import MovementReport

Ints = NDArray[np.intp]

REACH_MM = 6.0
"""Distance along the normal within which the stripe before and the one after show the same skin. Chosen by hand."""
STEEPEST, FARTHEST_MM = 3.0, 2.5
"""Slope of the skin along X, and distance from the chord, beyond which a comparison is left out. Chosen by hand."""
EVERY = 2
"""One point of so many is compared: they lie 0.3 mm apart along the stripe."""
FEWEST = 20
"""Comparisons that show the movement of a frame."""
LEAST_MM = 0.005
"""Least spread of the comparisons of a frame. Chosen by hand."""
NOISE_MM, PRIOR_MM = 0.1, 0.15
"""Standard deviations of what the skin's own form adds to a frame, and of the movement. Tuned on the points of one foot
with and without tremor (`draw_assembled`, seed 601): 0.03 to 0.06 mm remain of 0.3 mm."""
RIDGE = 1e-2
"""Added to the normal equations of a frame: directions that its stripes do not show stay at zero."""
FOURTH = np.array([0.25, -1.0, 1.5, -1.0, 0.25])
"""Second differences from the middle of both neighbours, taken twice."""
FORM = 0.3
"""Share of the standard deviation of a frame that does not follow from the form of the skin. Chosen by hand."""
POOR, CONTINUED = 2, 4
"""Frames at the ends whose movement is hardly known, since one neighbour is missing, and frames beyond them in which a
tremor goes on as it was. Chosen by hand."""
ROUNDS = 8
"""Iterations of the reweighted least squares: a bound of time."""
LEAST_TREMOR_MM, LEAST_AGREEMENT = 0.1, 0.5
"""Tremor from which the foot is moved back, and correlation between heads that it has at least. The form of a still
foot looks like 0.04 mm, heads that jitter like 0.08 mm. Tuned as `NOISE_MM`."""
MOVED_BACK = (
    "(root mean square), and was moved back: if a measure is uncertain, let the person sit or hold on to something, "
    "then scan again"
)
"""What a warning says of any movement that was taken back, after its size."""


class FrameMoves(NamedTuple):
    """How far the foot of each frame lies from the middle of the frames before and after."""

    first: int
    """Number of the first frame"""
    way: Floats
    """(F, 3) mm; NaN where it is not known"""
    sd: Floats
    """(F, 3) mm"""


def find_tremor(stripes: Stripes, heads: Mapping[int, int]) -> MovementReport:
    """Estimate the tremor of a foot, and the way by which it can be moved back.

    Parameters
    ----------
    stripes : of all cameras, without outliers, mm, scanner frame
    heads : camera -> number of its head; frames with one number are of one moment
    """
    comparisons = _compare(stripes)
    every = _moves(comparisons, np.ones(len(comparisons.frame), np.bool_))
    if every is None:
        return MovementReport()
    x, known = _integrated(every), np.isfinite(every.way[:, 0])
    tremor = float(np.sqrt(np.mean(x[known] ** 2)))
    report = MovementReport(tremor_mm=round(tremor, 4))
    if tremor < LEAST_TREMOR_MM:
        return report
    agreement = _agreement(comparisons, heads)
    report = report.model_copy(update={"agreement": agreement})
    if agreement is not None and agreement < LEAST_AGREEMENT:
        shaken = (
            f"stripes jump by {tremor:.2f} mm (root mean square) from frame to frame, and heads do not agree on it: "
            "look for play in rails and belts, then scan again"
        )
        return report.model_copy(update={"warnings": [shaken]})
    way = _continued(x, known)
    return report.model_copy(
        update={
            "first_frame": max(every.first - CONTINUED, 0),
            "x_mm": np.round(way[max(CONTINUED - every.first, 0) :], 4).tolist(),
            "warnings": [f"the foot trembled by {tremor:.2f} mm {MOVED_BACK}"],
        }
    )


class _Comparisons(NamedTuple):
    """M points, beside the stripes of the same camera before and after."""

    frame: Ints
    camera: Ints
    """Its number"""
    away: Floats
    """(M,) from the chord between those stripes, along the normal, mm"""
    change: Floats
    """(M, 3) derivatives of that by a movement of the foot in X, Y and Z"""


def _compare(stripes: Stripes) -> _Comparisons:
    sample = np.flatnonzero(stripes.points["supported"] & ~stripes.bent & np.any(stripes.normals != 0, axis=1))[::EVERY]
    away, slope = chord_beside(stripes, sample)
    good = (np.abs(slope) < STEEPEST) & (np.abs(away) < FARTHEST_MM)  # false for NaN
    return _of(stripes, sample[good], away[good], slope[good])


def chord_beside(stripes: Stripes, sample: Ints) -> tuple[Floats, Floats]:
    """How far the points `sample` (M,) lie from the chord between the stripes of the same camera before and after them,
    (M,) mm along their normals, and the slope (M,) of the chord along X; NaN where there is none."""
    before, x_before, after, x_after = ways_to_neighbours(
        sample,
        REACH_MM,
        GAP_STEPS * stripe_step(stripes.points),
        max(len(stripes.cameras), 1),
        traces_of(stripes, stripes.yz, stripes.sigma),
    ).T
    x, apart = stripes.x[sample], np.maximum(x_after - x_before, LEAST_MM)
    return -(before * (x_after - x) + after * (x - x_before)) / apart, (after - before) / apart


def _of(stripes: Stripes, sample: Ints, away: Floats, slope: Floats) -> _Comparisons:
    change = np.column_stack([-slope, stripes.normals[sample]])
    camera = stripes.cameras[stripes.camera[sample]]
    return _Comparisons(stripes.points["frame"][sample].astype(np.intp), camera, away, change)


def _moves(comparisons: _Comparisons, use: NDArray[np.bool_]) -> FrameMoves | None:
    """Movement of each frame by robust least squares; None without any frame that shows it."""
    if not use.any():
        return None
    first = int(comparisons.frame.min())
    count = int(comparisons.frame.max()) + 1 - first
    frame, away, change = comparisons.frame[use] - first, comparisons.away[use], comparisons.change[use]
    numbers = np.bincount(frame, minlength=count)
    order = np.argsort(frame, kind="stable")
    weights, spread = np.ones(len(frame)), np.full(count, LEAST_MM)
    way, normal = np.zeros((count, 3)), np.zeros((count, 3, 3))
    for _ in range(ROUNDS):
        for i, j in zip(*np.triu_indices(3), strict=True):
            normal[:, i, j] = normal[:, j, i] = np.bincount(frame, weights * change[:, i] * change[:, j], count)
        right = np.column_stack([np.bincount(frame, weights * away * change[:, k], count) for k in range(3)])
        way = np.asarray(np.linalg.solve(normal + RIDGE * np.eye(3), right[:, :, None])[:, :, 0])
        left = np.abs(away - np.einsum("mk,mk->m", change, way[frame]))
        spread = np.maximum(MAD_TO_SD * _medians(left[order], numbers), LEAST_MM)
        weights = huber_weights(left / spread[frame])
    # Errors of neighbouring points are correlated: of 20 of them, one counts.
    variance = FEWEST * np.diagonal(np.linalg.inv(normal + RIDGE * np.eye(3)), axis1=1, axis2=2)
    sd = np.sqrt(variance) * spread[:, None]
    shown = (numbers >= FEWEST)[:, None]
    if not shown.any():
        return None
    return FrameMoves(first, np.where(shown, way, np.nan), np.where(shown, sd, np.nan))


@compiled
def _medians(values: Floats, counts: Ints) -> Floats:
    """(G,) medians of groups of values (M,), of which each has so many (G,), one after the other; 0 of an empty one.

    >>> _medians(np.array([3.0, 1.0, 2.0, 7.0]), np.array([3, 0, 1])).tolist()
    [2.0, 0.0, 7.0]
    """
    medians, start = np.zeros(len(counts)), 0
    for group in range(len(counts)):
        if counts[group]:
            medians[group] = np.median(values[start : start + counts[group]])
        start += counts[group]
    return medians


def _integrated(moves: FrameMoves) -> Floats:
    """(F,) X of the foot in each frame, mm, from how far each lies beside its neighbours.

    The form of the skin also displaces a frame from the middle of its neighbours, but frames that follow each other
    about alike: second differences of the displacement are taken. They say nothing of slow movement; the prior leaves
    it at zero.
    """
    way, sd = moves.way[:, 0], moves.sd[:, 0]
    count = len(way)
    inner = np.arange(2, count - 2)
    known = inner[np.isfinite(way[inner - 1] + way[inner] + way[inner + 1])]
    if not known.size:
        return np.zeros(count)
    right = way[known] - 0.5 * (way[known - 1] + way[known + 1])
    noise = np.hypot(NOISE_MM, FORM * np.sqrt(sd[known] ** 2 + 0.25 * (sd[known - 1] ** 2 + sd[known + 1] ** 2)))
    weights, x = noise**-2.0, np.zeros(count)
    around = known[:, None] + np.arange(len(FOURTH)) - len(FOURTH) // 2
    for _ in range(ROUNDS):
        bands = np.zeros((len(FOURTH), count))
        for k in range(len(FOURTH)):
            products = FOURTH[: len(FOURTH) - k] * FOURTH[k:]
            bands[-1 - k] = np.bincount(around[:, k:].ravel(), np.outer(weights, products).ravel(), count)
        bands[-1] += PRIOR_MM**-2.0
        sums = np.bincount(around.ravel(), np.outer(weights * right, FOURTH).ravel(), count)
        x = np.asarray(solveh_banded(bands, sums, check_finite=False))
        weights = noise**-2.0 * cauchy_weights((right - x[around] @ FOURTH) / noise)
    return x


def _continued(x: Floats, known: NDArray[np.bool_]) -> Floats:
    """(F + 2 `CONTINUED`,) the movement x (F,) up to `CONTINUED` frames before and after, and at the ends of what is
    known of a pass: each frame by the two that follow it inwards. That is exact for a tremor of one frequency.

    >>> tremor = np.sin(2.5 * np.arange(40.0))
    >>> found = _continued(tremor, np.ones(40, np.bool_))
    >>> print(np.abs(found - np.sin(2.5 * np.arange(-CONTINUED, 40.0 + CONTINUED))).max().round(9))
    0.0
    """
    way = np.concatenate([np.zeros(CONTINUED), np.where(known, x, 0.0), np.zeros(CONTINUED)])
    shown = np.flatnonzero(known) + CONTINUED
    for of_pass in np.split(shown, np.flatnonzero(np.diff(shown) > BETWEEN_PASSES // 2) + 1):
        _continue(way, int(of_pass[0]) + POOR, int(of_pass[-1]) - POOR)
    return way


def _continue(way: Floats, first: int, last: int) -> None:
    """Continue the movement of the frames from `first` to `last` to both sides, in place."""
    if last - first < FEWEST:
        return
    inner = way[first : last + 1]
    pairs = np.column_stack([inner[1:-1], inner[2:]]), np.column_stack([inner[1:-1], inner[:-2]])
    ends = np.concatenate([inner[:-2], inner[2:]])
    (near, far), *_ = np.linalg.lstsq(np.concatenate(pairs), ends, rcond=None)
    for k in range(first - 1, max(first - POOR - CONTINUED, 0) - 1, -1):
        way[k] = near * way[k + 1] + far * way[k + 2]
    for k in range(last + 1, min(last + POOR + CONTINUED, len(way) - 1) + 1):
        way[k] = near * way[k - 1] + far * way[k - 2]


def _agreement(comparisons: _Comparisons, heads: Mapping[int, int]) -> float | None:
    """Least correlation between the movements that two heads show; None with fewer than two."""
    numbers = np.array([heads.get(int(camera), 0) for camera in range(int(comparisons.camera.max(initial=0)) + 1)])
    of_head = numbers[comparisons.camera] if len(comparisons.camera) else np.zeros(0, np.intp)
    found = [_moves(comparisons, of_head == head) for head in np.unique(of_head[of_head > 0])]
    courses = [(_integrated(moves), np.isfinite(moves.way[:, 0])) for moves in found if moves is not None]
    correlations = [
        float(np.corrcoef(first[known & also], second[known & also])[0, 1])
        for (first, known), (second, also) in combinations(courses, 2)
        if np.count_nonzero(known & also) > FEWEST and first.any() and second.any()
    ]
    return round(min(correlations), 3) if correlations else None

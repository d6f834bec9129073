"""Correction of the cameras: small motions by which they agree better on the skin that they share."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.agreement import Overlaps, find_overlaps
from footscan.cloud.fusion.correction_model import ALL_STRETCHES, STRETCHES, choose_terms, held_out, hold_the_middle
from footscan.cloud.fusion.motion import MOST_TERMS, SCALE_MM, TERMS, motion_terms, moved
from footscan.cloud.fusion.pair_least_squares import Forms, solve, sum_up
from footscan.cloud.fusion.stripes import Floats, Stripes
from footscan.robust import MAD_TO_SD, huber_weights, tukey_weights
from schemas.fusion import CameraCorrection
from schemas.parameters.fusion import FusionParameters

ROUNDS = 2
"""Rounds of the fit; the comparisons are repeated after the cameras were moved: a bound of time."""
LEAST_POINTS = 200
LEAST_STRETCHES = 6
"""Comparisons, and stretches with comparisons, from which a camera may be moved. Chosen by hand."""
REWEIGHTINGS = 6
"""Iterations of the robust least squares: a bound of time."""
GRID = 9
"""Points of a camera's range in Y and in Z at which its largest motion is searched."""
SHORTEST_MM = 1e-9
"""Lower bound of the travel by which is divided."""


class Corrected(NamedTuple):
    """The points after the cameras were moved."""

    yz: Floats
    """(N, 2) mm."""
    corrections: list[CameraCorrection]
    """One for each camera, in the order of `Stripes.cameras`."""
    too_far: dict[int, float]
    """Number of each camera that was not moved because its motion would be too large -> that motion, mm."""


class Frame(NamedTuple):
    """The coordinates in which motions are expressed."""

    centre: Floats
    """(2,) mm."""
    ranges: Floats
    """(C, 2, 2) least and greatest Y and Z of each camera's comparisons, mm."""


@dataclass(frozen=True)
class Comparisons:
    """The comparisons of the cameras, before any motion."""

    forms: Forms
    frame: Frame
    points: NDArray[np.intp]
    """(C,) number of comparisons of each camera."""
    enough: NDArray[np.bool_]
    """(C,) True if they are enough to move the camera."""


class CorrectionFit(NamedTuple):
    """Fitted motions of all cameras."""

    yz: Floats
    """(N, 2) the moved points, mm."""
    comparisons: Comparisons
    terms: NDArray[np.intp]
    """(C,) number of terms of each camera."""
    coefficients: Floats
    """(C, 12) mm."""


def correct(stripes: Stripes, overlaps: Overlaps, parameters: FusionParameters) -> Corrected:
    """Move the cameras that deviate from the others.

    The coefficients of all cameras are estimated together, by robust least squares over all pairs. Pairs do not
    determine a common motion of all cameras. As few cameras are moved as possible, since it is more likely that one
    camera was knocked than seven. A camera gets the terms, first rigid, then smooth, that lower the disagreement on
    stretches of the travel that were held out of the fit; without such terms it does not move.

    Parameters
    ----------
    overlaps : the comparisons of the unmoved points
    """
    if not parameters.correct_cameras or not len(overlaps.point):
        return Corrected(stripes.yz, [_unmoved(int(camera)) for camera in stripes.cameras], {})
    too_far: dict[int, float] = {}
    while True:
        trusted = ~np.isin(stripes.cameras, list(too_far))
        fit = _fit(stripes, overlaps, trusted, parameters)
        motions = _largest_motions(fit)
        far = np.flatnonzero(motions > parameters.largest_correction_mm)
        if not len(far):
            return Corrected(fit.yz, _reports(stripes, fit, motions), too_far)
        too_far |= {int(stripes.cameras[k]): float(motions[k]) for k in far}


def _fit(
    stripes: Stripes, overlaps: Overlaps, trusted: NDArray[np.bool_], parameters: FusionParameters
) -> CorrectionFit:
    """Fit the motions of all `trusted` cameras (C,)."""
    coefficients = np.zeros((len(stripes.cameras), MOST_TERMS))
    for round_ in range(ROUNDS):
        comparisons = _compare(stripes, overlaps, coefficients, trusted)
        terms = choose_terms(comparisons.forms, comparisons.enough, parameters.smallest_correction_mm)
        coefficients = solve(comparisons.forms, ALL_STRETCHES, terms)
        hold_the_middle(coefficients, terms, comparisons.enough)
        yz = _moved_all(stripes, comparisons.frame, coefficients)
        if not np.any(terms):
            break
        if round_ < ROUNDS - 1:
            overlaps = find_overlaps(stripes, yz, parameters.overlap_mm)
    return CorrectionFit(yz, comparisons, terms, coefficients)


def _compare(stripes: Stripes, overlaps: Overlaps, coefficients: Floats, trusted: NDArray[np.bool_]) -> Comparisons:
    """Sum up the overlaps of trusted cameras, which were found after the cameras were moved by `coefficients`."""
    count = len(stripes.cameras)
    cameras = np.column_stack([stripes.camera[overlaps.point], overlaps.other])
    use = trusted[cameras].all(axis=1)
    cameras, point = cameras[use], overlaps.point[use]
    yz, x = stripes.yz[point], stripes.x[point]
    stretch = np.floor((x - stripes.x[0]) / max(stripes.x[-1] - stripes.x[0], SHORTEST_MM) * STRETCHES).astype(np.intp)
    stretch = np.clip(stretch, 0, STRETCHES - 1)
    points = np.bincount(cameras.ravel(), minlength=count)
    seen = np.zeros((count, STRETCHES), np.bool_)
    seen[cameras[:, 0], stretch] = seen[cameras[:, 1], stretch] = True
    enough = (points >= LEAST_POINTS) & (seen.sum(axis=1) >= LEAST_STRETCHES)

    frame = Frame(stripes.yz.mean(axis=0), np.zeros((count, 2, 2)))
    for k in np.flatnonzero(points):
        mine = yz[np.any(cameras == k, axis=1)]
        frame.ranges[k] = mine.min(axis=0), mine.max(axis=0)
    terms = motion_terms(yz, frame.centre, frame.ranges[cameras[:, 0]])
    rows = np.einsum("nk,nkt->nt", stripes.normals[point], terms)
    apart = coefficients[cameras[:, 0]] - coefficients[cameras[:, 1]]
    distances = overlaps.distance[use] + np.einsum("nt,nt->n", rows, apart)
    variances = overlaps.variance[use]
    weights = _robust_weights(rows, distances, variances, cameras, enough)
    forms = sum_up(rows, distances, weights, variances, cameras, stretch, STRETCHES, count)
    return Comparisons(forms, frame, points, enough)


def _robust_weights(
    rows: Floats, distances: Floats, variances: Floats, cameras: NDArray[np.intp], enough: NDArray[np.bool_]
) -> Floats:
    """(M,) weights 1 / mm^2 of the comparisons, by their residuals from rigid motions of all cameras.

    Huber's weights come first, since they converge from any start; then Tukey's, which reject outliers completely.
    """
    once = np.zeros(len(rows), np.intp)
    rigid = TERMS["rigid"] * enough.astype(np.intp)
    weights = 1.0 / variances
    for turn in range(REWEIGHTINGS):
        forms = sum_up(rows, distances, weights, variances, cameras, once, 1, len(enough))
        fit = solve(forms, np.ones(1, np.bool_), rigid)
        left = np.abs(distances - np.einsum("nt,nt->n", rows, fit[cameras[:, 0]] - fit[cameras[:, 1]]))
        left /= np.sqrt(variances)
        left /= max(1.0, MAD_TO_SD * float(np.median(left)) if len(left) else 1.0)
        weights = (huber_weights if turn < REWEIGHTINGS - 1 else tukey_weights)(left) / variances
    return np.asarray(weights)


def _moved_all(stripes: Stripes, frame: Frame, coefficients: Floats) -> Floats:
    """(N, 2) the points of all cameras moved by `coefficients` (C, 12), mm."""
    yz = stripes.yz.copy()
    for k in np.flatnonzero(np.any(coefficients != 0, axis=1)):
        mine = stripes.camera == k
        yz[mine] = moved(yz[mine], coefficients[k], frame.centre, frame.ranges[k])
    return yz


def _largest_motions(fit: CorrectionFit) -> Floats:
    """(C,) the largest motion of a point in the range where each camera was compared, mm."""
    frame = fit.comparisons.frame
    motions = np.zeros(len(fit.terms))
    for k in np.flatnonzero(fit.terms):
        (low_y, low_z), (high_y, high_z) = frame.ranges[k]
        y, z = np.meshgrid(np.linspace(low_y, high_y, GRID), np.linspace(low_z, high_z, GRID))
        yz = np.column_stack([y.ravel(), z.ravel()])
        away = moved(yz, fit.coefficients[k], frame.centre, frame.ranges[k]) - yz
        motions[k] = np.hypot(away[:, 0], away[:, 1]).max()
    return motions


def _reports(stripes: Stripes, fit: CorrectionFit, motions: Floats) -> list[CameraCorrection]:
    """Describe the correction of each camera."""
    forms, frame = fit.comparisons.forms, fit.comparisons.frame
    before, after, weight = (
        (by_pair.sum(axis=1) + by_pair.sum(axis=2)).sum(axis=0)
        for by_pair in (forms.constant, held_out(forms, fit.terms), forms.weight)
    )
    kind_of = {terms: kind for kind, terms in TERMS.items()}
    reports = []
    for k, camera in enumerate(stripes.cameras):
        coefficients = fit.coefficients[k, : fit.terms[k]].tolist()
        is_compared = fit.comparisons.enough[k] and weight[k] > 0
        reports.append(
            CameraCorrection(
                camera=int(camera),
                kind=kind_of[int(fit.terms[k])],
                coefficients_mm=coefficients,
                centre_mm=(float(frame.centre[0]), float(frame.centre[1])),
                scale_mm=SCALE_MM,
                range_mm=tuple(frame.ranges[k].ravel().tolist()) if fit.comparisons.points[k] else None,
                shift_mm=(coefficients[0], coefficients[1]) if coefficients else (0.0, 0.0),
                rotation_deg=float(np.degrees(coefficients[2] / SCALE_MM)) if coefficients else 0.0,
                largest_mm=float(motions[k]),
                points=int(fit.comparisons.points[k]),
                held_out_before_mm=float(np.sqrt(before[k] / weight[k])) if is_compared else None,
                held_out_after_mm=float(np.sqrt(after[k] / weight[k])) if is_compared else None,
            )
        )
    return reports


def _unmoved(camera: int) -> CameraCorrection:
    return CameraCorrection(camera=camera, kind="none", points=0)

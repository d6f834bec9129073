"""Small motions of the cameras by which they agree better on the skin that they share."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.agreement import Overlaps, find_overlaps
from footscan.cloud.fusion.correction_model import EVERY, STRETCHES, choose_terms, held_out, hold_the_middle
from footscan.cloud.fusion.motion import MOST, SCALE_MM, TERMS, motion_terms, moved
from footscan.cloud.fusion.pair_least_squares import Forms, solve, sum_up
from footscan.cloud.fusion.stripes import Floats, Stripes
from footscan.robust import MAD_TO_SD
from schemas.fusion import CameraCorrection
from schemas.parameters.fusion import FusionParameters

ROUNDS = 2
"""What lies opposite of what is looked up again after the cameras were moved."""
LEAST_POINTS = 200
LEAST_STRETCHES = 6
"""A camera that is compared at fewer places, or over fewer stretches, stays where it is."""
TUKEY = 4.685
"""Comparisons beyond so many standard deviations count for nothing (Beaton and Tukey 1974)."""
HUBER = 1.345
"""Up to so many they count in full, in the first turns (Huber 1964)."""
REWEIGHTINGS = 6


class Corrected(NamedTuple):
    """The points after the cameras were moved."""

    yz: Floats
    """(N, 2) mm."""
    corrections: list[CameraCorrection]
    """One a camera, in their order."""
    too_far: dict[int, float]
    """Cameras that were not moved, since it would have been too far: by number, how far, mm."""


class Frame(NamedTuple):
    """In which motions are counted."""

    centre: Floats
    """(2,) mm."""
    ranges: Floats
    """(C, 2, 2) least and greatest Y and Z of each camera's comparisons, mm."""


@dataclass(frozen=True)
class Comparisons:
    """What cameras saw of each other, from where their points were mapped to."""

    forms: Forms
    frame: Frame
    points: NDArray[np.intp]
    """(C,) how many comparisons each camera takes part in."""
    enough: NDArray[np.bool_]
    """(C,) whether a camera may be moved by them."""


class Fit(NamedTuple):
    """Where the cameras are moved to."""

    yz: Floats
    comparisons: Comparisons
    terms: NDArray[np.intp]
    """(C,) how many each camera has."""
    coefficients: Floats
    """(C, 12) mm."""


def correct(stripes: Stripes, overlaps: Overlaps, parameters: FusionParameters) -> Corrected:
    """Moves the cameras that stand off the others.

    The coefficients of all cameras are sought together, by robust least squares over all pairs. That all move alike is
    nothing that pairs can tell: as few cameras are moved as possible, for it is one that was knocked, not seven. A
    camera gets the terms, first rigid, then smooth, that lower the disagreement over stretches of the travel which took
    no part in the fit, and stays where it is without.

    Parameters
    ----------
    overlaps : of the points as they stand
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


def _fit(stripes: Stripes, overlaps: Overlaps, trusted: NDArray[np.bool_], parameters: FusionParameters) -> Fit:
    coefficients = np.zeros((len(stripes.cameras), MOST))
    for round_ in range(ROUNDS):
        comparisons = _compare(stripes, overlaps, coefficients, trusted)
        terms = choose_terms(comparisons.forms, comparisons.enough, parameters.smallest_correction_mm)
        coefficients = solve(comparisons.forms, EVERY, terms)
        hold_the_middle(coefficients, terms, comparisons.enough)
        yz = _moved_all(stripes, comparisons.frame, coefficients)
        if not np.any(terms):
            break
        if round_ < ROUNDS - 1:
            overlaps = find_overlaps(stripes, yz, parameters.overlap_mm)
    return Fit(yz, comparisons, terms, coefficients)


def _compare(stripes: Stripes, overlaps: Overlaps, coefficients: Floats, trusted: NDArray[np.bool_]) -> Comparisons:
    """The overlaps of trusted cameras, found after the cameras were moved by `coefficients`, as quadratic forms."""
    count = len(stripes.cameras)
    cameras = np.column_stack([stripes.camera[overlaps.point], overlaps.other])
    use = trusted[cameras].all(axis=1)
    cameras, point = cameras[use], overlaps.point[use]
    yz, x = stripes.yz[point], stripes.x[point]
    stretch = np.floor((x - stripes.x[0]) / max(stripes.x[-1] - stripes.x[0], 1e-9) * STRETCHES).astype(np.intp)
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
    """(M,) weights 1 / mm^2 of the comparisons, held against rigid motions of all cameras.

    Huber's weights first, which find their way from anywhere, then Tukey's, for which strays count nothing.
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
        if turn < REWEIGHTINGS - 1:
            trust = HUBER / np.maximum(left, HUBER)
        else:
            trust = np.maximum(1.0 - (left / TUKEY) ** 2, 0.0) ** 2
        weights = trust / variances
    return np.asarray(weights)


def _moved_all(stripes: Stripes, frame: Frame, coefficients: Floats) -> Floats:
    yz = stripes.yz.copy()
    for k in np.flatnonzero(np.any(coefficients != 0, axis=1)):
        mine = stripes.camera == k
        yz[mine] = moved(yz[mine], coefficients[k], frame.centre, frame.ranges[k])
    return yz


def _largest_motions(fit: Fit) -> Floats:
    """(C,) how far a point is moved at most where the camera was compared, mm."""
    frame = fit.comparisons.frame
    motions = np.zeros(len(fit.terms))
    for k in np.flatnonzero(fit.terms):
        (low_y, low_z), (high_y, high_z) = frame.ranges[k]
        y, z = np.meshgrid(np.linspace(low_y, high_y, 9), np.linspace(low_z, high_z, 9))
        yz = np.column_stack([y.ravel(), z.ravel()])
        away = moved(yz, fit.coefficients[k], frame.centre, frame.ranges[k]) - yz
        motions[k] = np.hypot(away[:, 0], away[:, 1]).max()
    return motions


def _reports(stripes: Stripes, fit: Fit, motions: Floats) -> list[CameraCorrection]:
    forms, frame = fit.comparisons.forms, fit.comparisons.frame
    before, after, weight = (
        (by_pair.sum(axis=1) + by_pair.sum(axis=2)).sum(axis=0)
        for by_pair in (forms.constant, held_out(forms, fit.terms), forms.weight)
    )
    kind_of = {terms: kind for kind, terms in TERMS.items()}
    reports = []
    for k, camera in enumerate(stripes.cameras):
        coefficients = fit.coefficients[k, : fit.terms[k]].tolist()
        known = fit.comparisons.enough[k] and weight[k] > 0
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
                held_out_before_mm=float(np.sqrt(before[k] / weight[k])) if known else None,
                held_out_after_mm=float(np.sqrt(after[k] / weight[k])) if known else None,
            )
        )
    return reports


def _unmoved(camera: int) -> CameraCorrection:
    return CameraCorrection(camera=camera, kind="none", points=0)

"""Place of an end of a body that only stripes see: about at the last stripe that hits the body, and before the next.

Laser light is a sheet with a Gaussian profile of some standard deviation s. An end that lies e beyond the middle of the
sheet leaves the share Phi(e/s) of its light on the body, and the middle of that light lies s phi(e/s) / Phi(e/s)
farther in (mean of a truncated normal distribution). A camera that looks obliquely at the sheet sees this as a
displacement of the surface; the sign differs between cameras before and behind the sheet. A cloud does not determine s.
Therefore the place of an end is computed for each possible s, and the mean over all s is reported.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from footscan.cloud.points import PLANE_MM
from footscan.verify.shapes.fitting import Floats, robust_deviation

LEAST_PLANES = 5
"""Least number of stripe planes; chosen by hand."""
LEAST_POINTS = 5
"""Least number of points of a stripe; chosen by hand."""
FROM_END = 3
"""The third point from the end of a stripe is taken as its end, against outliers; chosen by hand."""
LAST_PLANES = 10
"""Number of planes near the end from which the step is taken; chosen by hand."""
SHARP = 0.25
"""Largest standard deviation of the points of a stripe plane along the travel, in steps; chosen by hand."""

SHEETS = 9
"""Number of standard deviations of the sheet that are tried, from the least to the largest"""
THINNEST_MM = 1e-3
"""Least standard deviation of the sheet"""
AGREEMENT = np.linspace(0.8, 1.2, 5)
"""Ratios of observed to theoretical displacement that are tried: light lies wider on one face than on another, and the
place of a camera is known to some per cent. Chosen by hand."""
FAINTEST = (0.01, 0.5)
"""Bounds of the unknown least share of its light with which a stripe is still seen; chosen by hand."""
OTHER_CAUSES = 1e-6
"""Likelihood that a displacement has other causes and does not depend on the end; chosen by hand."""
REACH_SIGMAS = 4.0
"""Distance from the last stripe up to which ends are tried, in standard deviations of the sheet"""
FINE_MM = 0.005
"""Step of the places that are tried; least uncertainty of a displacement"""


@dataclass(frozen=True)
class Sights:
    """The points of each camera before fusion, which would average out displacements."""

    points: Floats
    """(N, 3) mm, scanner frame"""
    camera: NDArray[np.integer]
    """(N,) camera of each point"""
    centres: Mapping[int, Floats]
    """Centre of each camera, (3,) mm, X counted from the laser plane"""


@dataclass(frozen=True)
class Beside:
    """Points on the faces adjacent to an end, (N,) each."""

    x: Floats
    """mm, travel coordinates"""
    outward: Floats
    """mm, along the outward normal of the end"""
    off_face: Floats
    """mm, distances from their faces, positive outside"""
    slope: Floats
    """Apparent distance from its face, in mm, of light 1 mm farther in than the sheet; NaN where unknown"""
    view: NDArray[np.integer]
    """A number for each camera and face"""


@dataclass(frozen=True)
class End:
    """Place of an end along an outward normal: estimates for each of the possible sheets, (S,), or for all, (1,).

    Both ends of a body are lit by the same sheet, so their errors are correlated.
    """

    place: Floats
    """mm"""
    variance: Floats
    """mm^2"""
    likelihood: Floats
    """Likelihood of the observation for each sheet"""


def known_end(place: float, uncertainty: float) -> End:
    """Make an end that does not depend on the sheet; both arguments in mm."""
    return End(np.array([place]), np.array([uncertainty**2]), np.ones(1))


def length_between(a: End, b: End) -> tuple[float, float]:
    """Returns the distance in mm of two opposite ends, places along opposite normals, and its standard uncertainty.

    Examples
    --------
    >>> length_between(known_end(20.0, 0.03), known_end(-8.0, 0.04))
    (12.0, 0.05)
    """
    place, variance = a.place + b.place, a.variance + b.variance
    weight = a.likelihood * b.likelihood
    weight = weight / weight.sum()
    length = float(weight @ place)
    return length, float(np.sqrt(weight @ (variance + (place - length) ** 2)))


def stripe_planes(x: Floats) -> Floats:
    """Returns (K,) mm, ascending, the places of the stripe planes of points with travel coordinates `x`, (N,).

    Empty if the points do not lie in stripe planes, such as points spread over a mesh.
    """
    ordered = np.sort(x)
    planes = np.split(ordered, np.flatnonzero(np.diff(ordered) > PLANE_MM) + 1)
    planes = [plane for plane in planes if len(plane) >= LEAST_POINTS]
    if len(planes) < LEAST_PLANES:
        return np.zeros(0)
    places = np.array([plane.mean() for plane in planes])
    deviation = np.median([plane.std() for plane in planes])
    return places if deviation <= SHARP * np.median(np.diff(places)) else np.zeros(0)


def end_between_stripes(
    beside: Beside, planes: Floats, cosine: float, crossing_mm: float, sheet_mm: tuple[float, float]
) -> End:
    """Locate an end of a body on which no points lie.

    If the end is square to the travel, at least a part of the last stripe lies on the body, and too little of the next
    one to be seen. The displacement of the last stripe shows how near the end is. Without a displacement the end lies
    beyond the reach of that stripe, anywhere before the reach of the next. If the end is oblique by more than a step,
    stripes cross its edge, and their last points lie on it.

    Parameters
    ----------
    beside : points on the adjacent faces
    planes : (K,) mm, the stripe planes
    cosine : of the angle between the outward normal and the travel, signed
    crossing_mm : reach of the end's edges along the travel
    sheet_mm : least and largest standard deviation of the light across its sheet, with a uniform prior between
    """
    step = float(np.median(np.diff(planes)))
    stripes = [np.flatnonzero(np.abs(beside.x - plane) <= SHARP * step) for plane in planes]
    stripes = [stripe for stripe in stripes if len(stripe) >= LEAST_POINTS]
    lasts = [float(np.partition(beside.outward[stripe], -FROM_END)[-FROM_END]) for stripe in stripes]
    last = int(np.argmax(lasts))
    last_planes = planes[-LAST_PLANES:] if cosine > 0 else planes[:LAST_PLANES]
    unseen = max(float(np.diff(last_planes).max()) - crossing_mm, 0.0) * abs(cosine)
    spacing = float(np.median([np.ptp(beside.outward[stripe]) / len(stripe) for stripe in stripes]))
    if unseen <= FINE_MM:
        return known_end(lasts[last] + FROM_END * spacing / 2, FROM_END * spacing / np.sqrt(12))

    sheets = np.maximum(np.linspace(*sheet_mm, SHEETS), THINNEST_MM)
    reach = REACH_SIGMAS * sheets[-1]
    places = np.arange(-reach, unseen + reach, FINE_MM) + lasts[last] + FINE_MM / 2
    seen = _chance_to_see((places - lasts[last]) / sheets[:, None])
    seen *= 1 - _chance_to_see((places - lasts[last] - unseen) / sheets[:, None])
    chances = seen[:, None] * _chance_of_displacement(beside, stripes, last, places, sheets)
    chances = chances.reshape(-1, len(places))
    likelihood = chances.sum(axis=1)
    by_place = chances / likelihood[:, None]
    mean = by_place @ places
    return End(mean, np.sum(by_place * (places - mean[:, None]) ** 2, axis=1), likelihood)


def _chance_to_see(beyond: Floats) -> Floats:
    """Probability to see a stripe for an end this many standard deviations beyond it.

    The logarithm of the least visible share of light has a uniform prior.
    """
    faintest, brightest = np.log(FAINTEST)
    return np.asarray(np.clip((log_ndtr(beyond) - faintest) / (brightest - faintest), 0.0, 1.0))


def _chance_of_displacement(
    beside: Beside, stripes: list[NDArray[np.intp]], last: int, places: Floats, sheets: Floats
) -> Floats:
    """Returns (S, G, P) likelihoods of the displacement of the last stripe for ends at `places`, (P,).

    The displacements of the other stripes, which are not cut, give its uncertainty.
    """
    seen = _medians(beside, stripes)
    weight = seen.counts * np.nan_to_num(seen.slope) ** 2  # of least squares
    if not weight[last].any():
        return np.ones((len(sheets), len(AGREEMENT), len(places)))
    usual = np.array([np.median(own[counts > 0]) for own, counts in zip(seen.off_face.T, seen.counts.T, strict=True)])
    inward = np.where(weight > 0, seen.off_face - usual, 0.0) / np.where(weight > 0, seen.slope, 1.0)
    lit = weight.any(axis=1)
    displaced = np.sum(inward * weight, axis=1) / np.where(lit, weight.sum(axis=1), 1.0)
    noise = max(robust_deviation(displaced[lit]), FINE_MM)

    of_last = weight[last] > 0
    share = weight[last, of_last] / weight[last].sum()
    beyond = (places - seen.outward[last, of_last, None]) / sheets[:, None, None]
    mills = np.exp(-0.5 * beyond**2 - 0.5 * np.log(2 * np.pi) - log_ndtr(beyond))  # phi / Phi
    expected = sheets[:, None] * np.einsum("v,svp->sp", share, mills)
    deviations = (displaced[last] - AGREEMENT[:, None] * expected[:, None]) / noise
    return np.asarray(np.exp(-0.5 * deviations**2) + OTHER_CAUSES)


@dataclass(frozen=True)
class _Medians:
    """Medians over the points of each stripe in each view, (stripes, views); 0 without points.

    The displacement of a point depends on its place along the normal, so the medians of both are used together.
    """

    counts: Floats
    off_face: Floats
    outward: Floats
    slope: Floats


def _medians(beside: Beside, stripes: list[NDArray[np.intp]]) -> _Medians:
    views = np.unique(beside.view)
    medians = np.zeros((4, len(stripes), len(views)))
    for k, stripe in enumerate(stripes):
        for v, view in enumerate(views):
            own = stripe[beside.view[stripe] == view]
            if len(own) >= LEAST_POINTS:
                values = (beside.off_face[own], beside.outward[own], beside.slope[own])
                medians[:, k, v] = len(own), *(float(np.median(value)) for value in values)
    return _Medians(*medians[:, :, medians[0].any(axis=0)])

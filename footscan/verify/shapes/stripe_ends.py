"""Where a body ends that is seen by stripes alone: somewhere about the last stripe that hits it, and before the next.

Laser light is a sheet with a Gaussian profile of some standard deviation s. An end that stands e beyond the middle of
the sheet leaves the share Phi(e/s) of its light on the body, and the middle of that lies s phi(e/s) / Phi(e/s) farther
in (mean of a truncated normal distribution). A camera that looks askew at the sheet takes this for a displacement of
the surface, one before the sheet to the one side and one behind it to the other. Nothing in a cloud tells s, so the
place of an end is worked out for each s that may be, and what is told of it is the mean over all of them.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from footscan.cloud.points import PLANE_MM
from footscan.verify.shapes.fitting import Floats, robust_deviation

LEAST_PLANES = 5
LEAST_POINTS = 5
FROM_END = 3
"""Of the points of a stripe, the third from the end counts, against outliers."""
LAST_PLANES = 10
SHARP = 0.25
"""Largest standard deviation of the points of a stripe plane along the travel, in steps."""

SHEETS = 9
"""Standard deviations between the least and the largest one that are tried."""
THINNEST_MM = 1e-3
AGREEMENT = np.linspace(0.8, 1.2, 5)
"""What is seen of a displacement, in parts of what theory says: light lies wider on one face than on another, and where
a camera stands is known to some per cent."""
FAINTEST = (0.01, 0.5)
"""A stripe is seen of which more than some share of its light is left. Nobody knows which, nor its order."""
OTHERWISE = 1e-6
"""Likelihood that a displacement has other causes, and says nothing of the end."""
REACH_SIGMAS = 4.0
FINE_MM = 0.005
"""Distance of the places that are tried, and the least uncertainty of a displacement."""


@dataclass(frozen=True)
class Sights:
    """What each camera saw, before all of it was made one cloud, in which displacements are averaged out."""

    points: Floats
    """(N, 3) mm"""
    camera: NDArray[np.integer]
    """(N,)"""
    centres: Mapping[int, Floats]
    """Where a camera stands, (3,) mm, X from the laser's plane."""


@dataclass(frozen=True)
class Beside:
    """Points on the faces beside an end, (N,) each."""

    x: Floats
    """mm, travel coordinates"""
    outward: Floats
    """mm, along the outward normal of the end"""
    off_face: Floats
    """mm, distances from their faces, positive outside"""
    slope: Floats
    """How far off its face light is seen that lies 1 mm farther in than the sheet; NaN where that is not known."""
    view: NDArray[np.integer]
    """A number for each camera and face"""


@dataclass(frozen=True)
class End:
    """Where a body ends along an outward normal: one estimate for each of the sheets that may be, (S,) or (1,) for all.

    Both ends of a body are lit by one sheet: what is wrong with it is wrong with both.
    """

    place: Floats
    """mm"""
    variance: Floats
    """mm^2"""
    likelihood: Floats
    """Of what was seen, were the sheet so."""


def known_end(place: float, uncertainty: float) -> End:
    """An end that no sheet is asked for."""
    return End(np.array([place]), np.array([uncertainty**2]), np.ones(1))


def length_between(a: End, b: End) -> tuple[float, float]:
    """Distance in mm of two opposite ends, places counted along opposite normals, and its standard uncertainty."""
    place, variance = a.place + b.place, a.variance + b.variance
    weight = a.likelihood * b.likelihood
    weight = weight / weight.sum()
    length = float(weight @ place)
    return length, float(np.sqrt(weight @ (variance + (place - length) ** 2)))


def stripe_planes(x: Floats) -> Floats:
    """(K,) mm, ascending: the places of the stripe planes that points with travel coordinates `x`, (N,), lie in.

    Empty where they lie in no such planes, as points spread over a mesh do.
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
    """Where an end of a body stands that no point lies on.

    Where the end is square to the travel, the last stripe lies on the body, at least in part, and the next one does
    not, or too little of it to be seen. How far the last one is seen displaced tells how near the end is. One that is
    not says that the end is out of its reach, and then nothing is known between the reaches of both. Where the end is
    askew by more than a step, stripes run out over its edge, and their last points are on it.

    Parameters
    ----------
    planes : (K,) mm, the stripe planes
    cosine : of the angle of the normal to the travel, signed
    crossing_mm : how far the end's edges reach along the travel
    sheet_mm : least and largest standard deviation of the light across its sheet, any between them as likely
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
    """Of stripes that an end stands so many standard deviations beyond; the logarithm of the share is uniform."""
    faintest, brightest = np.log(FAINTEST)
    return np.asarray(np.clip((log_ndtr(beyond) - faintest) / (brightest - faintest), 0.0, 1.0))


def _chance_of_displacement(
    beside: Beside, stripes: list[NDArray[np.intp]], last: int, places: Floats, sheets: Floats
) -> Floats:
    """(S, G, P) likelihood, were the end at `places`, (P,), of how far the last stripe is seen displaced.

    How far stripes are that nothing cuts says how sure that is.
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
    return np.asarray(np.exp(-0.5 * deviations**2) + OTHERWISE)


@dataclass(frozen=True)
class _Medians:
    """Of the points that each view has of each stripe, (stripes, views); 0 where it has none.

    How far a point is displaced falls with its own place along the normal, so their medians go together.
    """

    counts: Floats
    off_face: Floats
    outward: Floats
    slope: Floats


def _medians(beside: Beside, stripes: list[NDArray[np.intp]]) -> _Medians:
    views = np.unique(beside.view)
    found = np.zeros((4, len(stripes), len(views)))
    for k, stripe in enumerate(stripes):
        for v, view in enumerate(views):
            own = stripe[beside.view[stripe] == view]
            if len(own) >= LEAST_POINTS:
                values = (beside.off_face[own], beside.outward[own], beside.slope[own])
                found[:, k, v] = len(own), *(float(np.median(value)) for value in values)
    return _Medians(*found[:, :, found[0].any(axis=0)])

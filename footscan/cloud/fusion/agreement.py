"""Distances at which two cameras place the same skin."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.stripes import Floats, Stripes, Traces, meet, traces_of
from footscan.cloud.points import PLANE_MM, stripe_step
from footscan.compiled import compiled
from footscan.robust import MAD_TO_SD
from schemas.fusion import Disagreement

Pairs = dict[tuple[int, int], tuple[int, Disagreement]]
"""Numbers of two cameras -> the number of places at which they were compared, and their disagreement."""

COMPARED = 12_000
"""Points that are compared with all other cameras, about: a bound of time."""
PATCH_MM, PATCH_SECTORS, FEWEST_IN_PATCH = 20.0, 8, 10
"""A patch of skin: its length along the travel, the sectors of its normal, and the comparisons from which their mean
shows more of the cameras than of the noise. Chosen by hand."""
GAP_STEPS = 1.5
"""Steps of the travel between two planes up to which the skin between their stripes counts as straight. Chosen by
hand."""


@dataclass(frozen=True)
class Overlaps:
    """M comparisons of a point of one camera with the stripe of another camera."""

    point: NDArray[np.intp]
    """(M,) index of the point."""
    other: NDArray[np.intp]
    """(M,) index of the other camera."""
    distance: Floats
    """(M,) distance from the point to the other stripe along the point's normal, mm, signed like the normal."""
    variance: Floats
    """(M,) expected variance of the distance, mm^2, from the sigmas of both."""


def find_overlaps(stripes: Stripes, yz: Floats, reach_mm: float) -> Overlaps:
    """Compare the cameras at an evenly spread sample of their points.

    The stripe of the other camera is taken in the plane of the point. If the planes of the cameras lie between each
    other, it is interpolated between the stripes before and after the point. A chord lies inside round skin, so each
    camera of a pair then sees the other one too far in, both by the same distance.

    Parameters
    ----------
    yz : (N, 2) float64, mm, the coordinates of the points, which may have been moved.
    reach_mm : largest distance along the normal.
    """
    usable = stripes.points["supported"] & ~stripes.bent & np.any(stripes.normals != 0, axis=1)
    candidates = np.flatnonzero(usable)
    sample = candidates[:: max(1, len(candidates) // COMPARED)].copy()
    count = len(stripes.cameras)
    if count < 2:
        sample = sample[:0]
    point, other, distance, variance = _compare(
        sample,
        reach_mm,
        GAP_STEPS * stripe_step(stripes.points),
        count,
        usable,
        traces_of(stripes, yz, stripes.sigma),
    )
    return Overlaps(point, other, distance, variance)


def disagreements(stripes: Stripes, overlaps: Overlaps) -> Pairs:
    """Summarise the distances of each pair of cameras that saw the same skin.

    A distance is positive if the camera with the smaller number places the skin farther out.

    Examples
    --------
    Two cameras see an arch, the second one 0.1 mm farther out:

    >>> from footscan.cloud.fusion.stripes import sort_stripes
    >>> from footscan.cloud.points import make_points
    >>> angle = np.linspace(0.0, np.pi, 200)
    >>> arch = np.column_stack([np.zeros(200), np.cos(angle), np.sin(angle)])
    >>> clouds = [make_points(radius * arch, camera, source=np.arange(200)) for camera, radius in ((1, 60), (2, 60.1))]
    >>> stripes = sort_stripes(clouds)
    >>> _, disagreement = disagreements(stripes, find_overlaps(stripes, stripes.yz, 1.0))[1, 2]
    >>> print(round(disagreement.median_mm, 3))
    -0.1
    """
    normals = stripes.normals[overlaps.point]
    outward = np.sign(np.sum(normals * (stripes.yz - _middles(stripes))[overlaps.point], axis=1))
    camera = stripes.camera[overlaps.point]
    farther_out = -overlaps.distance * outward * np.where(camera < overlaps.other, 1.0, -1.0)
    first, second = np.minimum(camera, overlaps.other), np.maximum(camera, overlaps.other)
    patch = _patches(stripes.x[overlaps.point], normals * outward[:, np.newaxis])
    pairs = {}
    for a, b in combinations(range(len(stripes.cameras)), 2):
        of_pair = (first == a) & (second == b)
        if of_pair.any():
            found = int(of_pair.sum()), _disagreement(farther_out[of_pair], patch[of_pair])
            pairs[int(stripes.cameras[a]), int(stripes.cameras[b])] = found
    return pairs


def _patches(x: Floats, outward: Floats) -> NDArray[np.intp]:
    """(M,) the number of the patch of skin at each `x`, mm, with the `outward` normal (M, 2)."""
    turn = np.arctan2(outward[:, 1], outward[:, 0]) / (2.0 * np.pi)
    sector = np.floor(PATCH_SECTORS * turn).astype(np.intp) % PATCH_SECTORS
    length = np.floor((x - x.min(initial=np.inf)) / PATCH_MM).astype(np.intp)
    return np.asarray(length * PATCH_SECTORS + sector)


def _disagreement(apart: Floats, patch: NDArray[np.intp]) -> Disagreement:
    median = float(np.median(apart))
    counts = np.bincount(patch)
    often = counts >= FEWEST_IN_PATCH
    means = np.abs(np.bincount(patch, apart)[often] / counts[often])
    return Disagreement(
        median_mm=median,
        deviation_mm=MAD_TO_SD * float(np.median(np.abs(apart - median))),
        rms_mm=float(np.sqrt(np.mean(apart**2))),
        systematic_mm=float(np.median(np.repeat(means, counts[often]))) if often.any() else None,
    )


def _middles(stripes: Stripes) -> Floats:
    """(N, 2) the mean of the points in each point's plane, mm; outward is the direction from there to the skin."""
    count = np.maximum(np.bincount(stripes.plane), 1)
    sums = np.column_stack([np.bincount(stripes.plane, stripes.yz[:, k]) for k in (0, 1)])
    return np.asarray((sums / count[:, np.newaxis])[stripes.plane])


@compiled
def _compare(
    sample: NDArray[np.intp],
    reach: float,
    gap: float,
    cameras: int,
    usable: NDArray[np.bool_],
    traces: Traces,
) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats, Floats]:
    """The fields of `Overlaps`, for the points of `sample`."""
    camera, plane, starts, x, yz, sigma, normals, linked, around = traces
    points, others = np.empty(len(sample) * cameras, np.intp), np.empty(len(sample) * cameras, np.intp)
    distances, variances = np.empty(len(sample) * cameras), np.empty(len(sample) * cameras)
    count = 0
    for n in sample:
        for b in range(cameras):
            if b == camera[n]:
                continue
            near = _plane_of(b, plane[n], -1, cameras, starts)
            first, last = starts[near * cameras + b], starts[near * cameras + b + 1]
            if first == last or x[n] - x[first] > gap:
                continue
            k, share, distance = meet(n, first, last, reach, yz, normals, linked, around)
            if k < 0 or not (usable[k] and usable[k + 1]):
                continue
            variance = (1 - share) * sigma[k] ** 2 + share * sigma[k + 1] ** 2
            met_x = x[k] + share * (x[k + 1] - x[k])
            if abs(x[n] - met_x) > PLANE_MM:
                # Planes that are turned against each other cross: the next one is on either side.
                way = 1 if x[n] > met_x else -1
                far = _plane_of(b, near + way, way, cameras, starts)
                first, last = starts[far * cameras + b], starts[far * cameras + b + 1]
                if first == last or abs(x[first] - met_x) > gap + abs(x[n] - met_x):
                    continue
                k, share, there = meet(n, first, last, reach, yz, normals, linked, around)
                if k < 0 or not (usable[k] and usable[k + 1]):
                    continue
                far_x = x[k] + share * (x[k + 1] - x[k])
                if (far_x - x[n]) * way < 0.0 or abs(far_x - met_x) > gap:
                    continue
                part = (x[n] - met_x) / (far_x - met_x)
                distance = (1 - part) * distance + part * there
                variance = (1 - part) * variance + part * ((1 - share) * sigma[k] ** 2 + share * sigma[k + 1] ** 2)
            points[count], others[count], distances[count] = n, b, distance
            variances[count] = variance + sigma[n] ** 2
            count += 1
    return points[:count], others[:count], distances[:count], variances[:count]


@compiled
def _plane_of(camera: int, plane: int, way: int, cameras: int, starts: NDArray[np.intp]) -> int:
    """The first plane from `plane` on, up or down by `way`, in which a camera has points; the last one if none has."""
    planes = (len(starts) - 1) // max(cameras, 1)
    plane = min(max(plane, 0), planes - 1)
    while 0 < plane < planes - 1 and starts[plane * cameras + camera] == starts[plane * cameras + camera + 1]:
        plane += way
    return plane

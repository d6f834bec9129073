"""Fusion of the points of all cameras to one cloud."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.agreement import Pairs, disagreements, find_overlaps
from footscan.cloud.fusion.correction import LEAST_POINTS, correct
from footscan.cloud.fusion.merge import merge
from footscan.cloud.fusion.stripes import Floats, Stripes, sort_stripes
from footscan.cloud.outliers.alone import is_off_alone
from footscan.cloud.outliers.off_surface import is_off_shared_surface
from schemas.calibration import view_name
from schemas.fusion import FusionReport, PairDisagreement
from schemas.parameters.fusion import FusionParameters

WORSE_MM = 0.05
"""Increase of the distance between two cameras, median over what both see, from which it is reported. Chosen by
hand."""


class Fusion(NamedTuple):
    """The cloud of all cameras, and a report on their agreement."""

    cloud: NDArray[np.void]
    """(M,) of `POINT_DTYPE`, mm, scanner frame; ordered by laser plane, then Y, then Z."""
    report: FusionReport


def fuse(
    points: NDArray[np.void] | Iterable[NDArray[np.void]],
    parameters: FusionParameters,
    heads: Mapping[int, int] | None = None,
) -> Fusion:
    """Fuse the points of several cameras to one cloud in which skin that several cameras saw appears once.

    The distance at which two cameras place the same skin is measured for each pair. Cameras that deviate from the
    others are moved if that improves the agreement on held-out data. Then the stripes of all cameras in one laser plane
    are averaged across the stripe, with weights 1 / sigma^2, and thinned out. Points that one camera alone saw, off the
    surface that several cameras saw, are dropped (`off_surface`).

    Parameters
    ----------
    points : one array of `POINT_DTYPE`, or one for each camera, mm, scanner frame. Points are ordered along the stripe
        by `source`, or, if it is equal, as they are given. Points that are not finite are left out.
    heads : camera -> number of its head, for the report

    Returns
    -------
    The cloud and its report; they do not depend on the order of cameras.

    Examples
    --------
    Two cameras see the same straight stripe 0.1 mm apart, equally well:

    >>> from footscan.cloud.points import make_points
    >>> lower = make_points(np.array([[0.0, y, 10.0] for y in range(5)]), camera=1, source=np.arange(5))
    >>> upper = make_points(np.array([[0.0, y, 10.1] for y in range(5)]), camera=2, source=np.arange(5))
    >>> cloud, report = fuse([lower, upper], FusionParameters())
    >>> print(len(cloud), cloud["z"].round(3), cloud["cameras"])
    5 [10.05 10.05 10.05 10.05 10.05] [2 2 2 2 2]
    """
    stripes = sort_stripes([points] if isinstance(points, np.ndarray) else points)
    overlaps = find_overlaps(stripes, stripes.yz, parameters.overlap_mm)
    before = disagreements(stripes, overlaps)
    if parameters.method == "concatenate":
        return _concatenated(stripes, before, heads or {})
    corrected = correct(stripes, overlaps, parameters)
    after = before
    if corrected.yz is not stripes.yz:
        after = disagreements(stripes, find_overlaps(stripes, corrected.yz, parameters.overlap_mm))
    deviation = np.array([corrected.too_far.get(int(camera), 0.0) for camera in stripes.cameras])
    merged = merge(
        replace(stripes, sigma=np.hypot(stripes.sigma, deviation[stripes.camera])) if np.any(deviation) else stripes,
        corrected.yz,
        np.where(deviation > 0, parameters.overlap_mm, parameters.contradiction_mm),
        _deviations(stripes, after),
        parameters,
    )
    off = is_off_shared_surface(merged.points) | is_off_alone(merged.points)
    lonely = np.bincount(merged.points["camera"][off], minlength=256)
    report = FusionReport(
        pairs=_pairs(before, after),
        corrections=corrected.corrections,
        distrusted=sorted(corrected.too_far),
        contradicted={camera: count + int(lonely[camera]) for camera, count in merged.contradicted.items()},
        warnings=[
            f"camera {view_name(camera)} deviates from the others by {away:.2f} mm, expected "
            f"{parameters.largest_correction_mm:g} mm at most: it was moved since the calibration, or its travel is "
            "not what the scan says; check the camera with 'footscan calibrate check'"
            for camera, away in sorted(corrected.too_far.items())
        ]
        + [*_worse(before, after)],
        heads=_present(heads or {}, stripes),
    )
    return Fusion(merged.points.compress(~off), report)


def _concatenated(stripes: Stripes, pairs: Pairs, heads: Mapping[int, int]) -> Fusion:
    """All points of all cameras as they are."""
    order = np.lexsort([stripes.yz[:, 1], stripes.yz[:, 0], stripes.plane])
    report = FusionReport(pairs=_pairs(pairs, pairs), heads=_present(heads, stripes))
    return Fusion(stripes.points.take(order), report)


def _present(heads: Mapping[int, int], stripes: Stripes) -> dict[int, int]:
    return {camera: head for camera, head in heads.items() if camera in stripes.cameras}


def _pairs(before: Pairs, after: Pairs) -> list[PairDisagreement]:
    return [
        PairDisagreement(cameras=pair, points=count, before=disagreement, after=after.get(pair, before[pair])[1])
        for pair, (count, disagreement) in before.items()
    ]


def _worse(before: Pairs, after: Pairs) -> Iterator[str]:
    """Name the pairs of cameras that agree worse after the correction.

    >>> from schemas.fusion import Disagreement
    >>> disagreements = [Disagreement(median_mm=mm, deviation_mm=0.02, rms_mm=mm) for mm in (0.03, 0.2)]
    >>> next(_worse(*({(1, 5): (400, disagreement)} for disagreement in disagreements)))
    'cameras 1 and 5 agree worse after the correction of the cameras: 0.03 mm apart before, 0.20 mm after; if the \
foot moved, scan again'
    """
    for pair, (count, was) in before.items():
        now = after.get(pair, before[pair])[1]
        if count >= LEAST_POINTS and abs(now.median_mm) > abs(was.median_mm) + WORSE_MM:
            first, second = map(view_name, pair)
            yield (
                f"cameras {first} and {second} agree worse after the correction of the cameras: "
                f"{abs(was.median_mm):.2f} mm apart before, {abs(now.median_mm):.2f} mm after; if the foot "
                "moved, scan again"
            )


def _deviations(stripes: Stripes, pairs: Pairs) -> Floats:
    """(C, C) standard deviations of the distances between two cameras, mm; 0 for pairs that were not compared."""
    number = {int(camera): k for k, camera in enumerate(stripes.cameras)}
    deviations = np.zeros((len(number), len(number)))
    for (a, b), (_, disagreement) in pairs.items():
        deviations[number[a], number[b]] = deviations[number[b], number[a]] = disagreement.deviation_mm
    return deviations

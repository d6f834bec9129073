"""The points of all cameras to one cloud."""

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.fusion.agreement import Pairs, disagreements, find_overlaps
from footscan.cloud.fusion.correction import correct
from footscan.cloud.fusion.merge import merge
from footscan.cloud.fusion.stripes import Floats, Stripes, sort_stripes
from schemas.fusion import FusionReport, PairDisagreement
from schemas.parameters.fusion import FusionParameters


class Fusion(NamedTuple):
    """One cloud of all cameras, and how well they agree."""

    cloud: NDArray[np.void]
    """(M,) of `POINT_DTYPE`, mm, scanner frame; ordered by laser plane, then Y, then Z."""
    report: FusionReport


def fuse(points: NDArray[np.void] | Iterable[NDArray[np.void]], parameters: FusionParameters) -> Fusion:
    """One cloud of the points of several cameras, in which skin that several saw is there once.

    How far apart the cameras place the same skin is measured for each pair of them. Cameras that stand off the others
    are moved if they agree better for it where they were not fitted. Then what cameras see in one laser plane is
    averaged across the stripe, with weights 1 / sigma^2, and thinned out.

    Parameters
    ----------
    points : array of `POINT_DTYPE` of all cameras, or several of them, mm, scanner frame. Along the stripe, points
        follow each other as `source` does, or as they stand where it is the same. What is not finite is left out.

    Returns
    -------
    The same for any order of cameras. A cloud of the points as they are, where there is nothing to compare.
    """
    stripes = sort_stripes([points] if isinstance(points, np.ndarray) else points)
    overlaps = find_overlaps(stripes, stripes.yz, parameters.overlap_mm)
    before = disagreements(stripes, overlaps)
    corrected = correct(stripes, overlaps, parameters)
    after = before
    if corrected.yz is not stripes.yz:
        after = disagreements(stripes, find_overlaps(stripes, corrected.yz, parameters.overlap_mm))
    off = np.array([corrected.too_far.get(int(camera), 0.0) for camera in stripes.cameras])
    merged = merge(
        replace(stripes, sigma=np.hypot(stripes.sigma, off[stripes.camera])) if np.any(off) else stripes,
        corrected.yz,
        np.where(off > 0, parameters.overlap_mm, parameters.contradiction_mm),
        _deviations(stripes, after),
        parameters,
    )
    report = FusionReport(
        pairs=[
            PairDisagreement(cameras=pair, points=count, before=disagreement, after=after.get(pair, before[pair])[1])
            for pair, (count, disagreement) in before.items()
        ],
        corrections=corrected.corrections,
        contradicted=merged.contradicted,
        warnings=[
            f"camera {camera} stands {away:.2f} mm off the others, expected {parameters.largest_correction_mm:g} mm at "
            "most: it was moved since the calibration, or its travel is not what the scan says"
            for camera, away in sorted(corrected.too_far.items())
        ],
    )
    return Fusion(merged.points, report)


def _deviations(stripes: Stripes, pairs: Pairs) -> Floats:
    """(C, C) standard deviations of the distances between each two cameras, mm; 0 where they were not compared."""
    number = {int(camera): k for k, camera in enumerate(stripes.cameras)}
    deviations = np.zeros((len(number), len(number)))
    for (a, b), (_, disagreement) in pairs.items():
        deviations[number[a], number[b]] = deviations[number[b], number[a]] = disagreement.deviation_mm
    return deviations

"""Agreement of two cameras: the distance at which they place the same edge."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.edge_points import BLOCK_MM, EdgePoints
from footscan.calibration.models.maps import to_world
from footscan.calibration.models.selection import rms
from schemas.calibration import CameraCalibration, PairAgreement

Floats = NDArray[np.float64]
EdgeStretch = tuple[int, int, int]
"""Number of the placement, of the edge, and of the stretch of `BLOCK_MM` along it."""

FEWEST_POINTS = 3
"""Points of a stretch from which its place is measured. Chosen by hand."""


def pair_agreements(cameras: Mapping[int, CameraCalibration], points: Mapping[int, EdgePoints]) -> list[PairAgreement]:
    """Measure the disagreement of each pair of cameras on the stretches of edges that both see.

    It is measured across the edges, in mm, since the place along an edge is not observed.

    Parameters
    ----------
    cameras, points : camera -> its calibration, and the points of its stripe on edges.
    """
    offsets = {camera: _offsets(cameras[camera], points[camera]) for camera in cameras}
    pairs = []
    for a, b in combinations(sorted(cameras), 2):
        shared = sorted(offsets[a].keys() & offsets[b].keys())
        if shared:
            apart = np.array([offsets[a][place] - offsets[b][place] for place in shared])
            pairs.append(
                PairAgreement(
                    cameras=(a, b),
                    places=len(shared),
                    rms_mm=rms(apart),
                    worst_mm=float(np.abs(apart).max()),
                )
            )
    return pairs


def _offsets(camera: CameraCalibration, points: EdgePoints) -> dict[EdgeStretch, float]:
    """The median distance, mm, from the true edge at which a camera places each stretch of it."""
    across = points.across(to_world(camera, points.pixels))
    stretch = np.floor(points.along / BLOCK_MM).astype(np.intp)
    places, number, count = np.unique(
        np.column_stack([points.placement, points.edge, stretch]), axis=0, return_inverse=True, return_counts=True
    )
    return {
        (int(place[0]), int(place[1]), int(place[2])): float(np.median(across[number.ravel() == k]))
        for k, place in enumerate(places)
        if count[k] >= FEWEST_POINTS
    }

"""How far apart two cameras place one and the same edge."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.edge_points import BLOCK_MM, EdgePoints
from footscan.calibration.models.maps import to_world
from footscan.calibration.models.selection import rms
from schemas.calibration import CameraCalibration, PairAgreement

Floats = NDArray[np.float64]
Place = tuple[int, int, int]
"""Placement, edge, and a stretch of `BLOCK_MM` along it."""

FEWEST_POINTS = 3


def pair_agreements(cameras: Mapping[int, CameraCalibration], points: Mapping[int, EdgePoints]) -> list[PairAgreement]:
    """The disagreement of each pair of cameras over the stretches of edges that both see, across the edges, in mm.

    Along an edge there is nothing to hold on to.
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


def _offsets(camera: CameraCalibration, points: EdgePoints) -> dict[Place, float]:
    """Where a camera places each stretch of an edge, across it: the median distance from the true edge, mm."""
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

"""Stripes of two cameras, one on either side of a foot that moves."""

from functools import cache

import numpy as np

from footscan.cloud.points import make_points
from footscan.virtual.foot.foot import make_foot

STEP_MM, FRAMES = 2.0, 90  # up to the toes, whose sections are several
HEADS = {1: 1, 2: 2}


def scan(x_mm: np.ndarray, y_mm: np.ndarray | None = None, ahead_mm: float = 0.0, pitch: float = 0.0) -> np.ndarray:
    """Points of a foot that lies at `x_mm` (2, F) along and `y_mm` (2, F) across the travel for each of the cameras.

    The laser plane of the second one is ahead of that of the first, and leans back by `pitch` mm per mm of height.
    """
    y_mm = np.zeros_like(x_mm) if y_mm is None else y_mm
    parts = []
    for camera, side in ((1, 1.0), (2, -1.0)):
        for frame in range(FRAMES):
            plane = 8.0 + STEP_MM * frame + (camera - 1) * ahead_mm
            leans = pitch * (camera - 1)
            section = _section_at(plane - x_mm[camera - 1, frame], leans)
            section = section[side * (section[:, 0] - section[:, 0].mean()) > -10.0]
            angle = np.arctan2(section[:, 1] - section[:, 1].mean(), section[:, 0] - section[:, 0].mean())
            section = section[np.argsort(angle)] + [y_mm[camera - 1, frame], 0.0]
            xyz = np.column_stack([plane - leans * section[:, 1], section])
            at = np.full(len(section), plane, np.float32)
            parts.append(make_points(xyz, camera, frame, source=np.arange(len(section)), plane=at))
    return np.concatenate(parts)


@cache
def _foot_edges() -> tuple[np.ndarray, np.ndarray]:
    """Both ends (E, 3) of each edge of a foot, mm."""
    foot = make_foot(resolution_mm=2.0)
    pairs = [foot.faces[:, list(pair)] for pair in ((0, 1), (1, 2), (2, 0))]
    edges = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    return foot.vertices[edges[:, 0]], foot.vertices[edges[:, 1]]


def _section_at(x: float, pitch: float) -> np.ndarray:
    """(N, 2) Y and Z where the edges of the foot cross the plane at X = x - pitch * Z, mm."""
    first, second = _foot_edges()
    ahead, beyond = (ends[:, 0] + pitch * ends[:, 2] - x for ends in (first, second))
    crosses = (ahead < 0.0) != (beyond < 0.0)
    first, second, ahead, beyond = first[crosses], second[crosses], ahead[crosses], beyond[crosses]
    return np.asarray((first + (ahead / (ahead - beyond))[:, None] * (second - first))[:, 1:])

"""Segments of stripe: points that follow each other in one frame of one camera."""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Coordinate = NDArray[np.float32]
Ints = NDArray[np.int32]


def segments_of(points: NDArray[np.void], gap_mm: float, longest_mm: float) -> tuple[Ints, Ints]:
    """The number of the segment that each point belongs to, from 0 on without gaps, and its place from an end.

    Both are (N,) int32; the place is 0 for the first and the last point of a piece of stripe, 1 for those next to them.
    A segment goes on while points that follow each other along the stripe, as their `source` has it, lie no farther
    than `gap_mm` from each other in the laser's plane; it is cut into even parts where it is longer than `longest_mm`.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, coordinates finite, in any order
    """
    camera, frame, source, y, z = (points[name].copy() for name in ("camera", "frame", "source", "y", "z"))
    if _sorted(camera, frame, source):
        return _number(camera, frame, y, z, gap_mm, longest_mm)
    order = np.lexsort((source, frame, camera))
    segment, place = np.empty(len(points), np.int32), np.empty(len(points), np.int32)
    segment[order], place[order] = _number(camera[order], frame[order], y[order], z[order], gap_mm, longest_mm)
    return segment, place


@compiled
def _sorted(camera: NDArray[np.uint8], frame: NDArray[np.int32], source: NDArray[np.int32]) -> bool:
    for n in range(1, len(camera)):
        if camera[n] != camera[n - 1]:
            if camera[n] < camera[n - 1]:
                return False
        elif frame[n] != frame[n - 1]:
            if frame[n] < frame[n - 1]:
                return False
        elif source[n] < source[n - 1]:
            return False
    return True


@compiled
def _number(
    camera: NDArray[np.uint8], frame: NDArray[np.int32], y: Coordinate, z: Coordinate, gap: float, longest: float
) -> tuple[Ints, Ints]:
    segment, place = np.zeros(len(y), np.int32), np.zeros(len(y), np.int32)
    along = np.zeros(len(y))
    start = segments = 0
    for n in range(1, len(y) + 1):
        apart = np.hypot(y[n] - y[n - 1], z[n] - z[n - 1]) if n < len(y) else np.inf
        if apart <= gap and camera[n] == camera[n - 1] and frame[n] == frame[n - 1]:
            along[n] = along[n - 1] + apart
            continue
        parts = max(math.ceil(along[n - 1] / longest), 1)
        for m in range(start, n):
            segment[m] = segments + min(int(parts * along[m] / max(along[n - 1], 1e-9)), parts - 1)
            place[m] = min(m - start, n - 1 - m)
        segments += parts
        start = n
    return segment, place

"""Segments of stripe: consecutive points in one frame of one camera."""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Coordinate = NDArray[np.float32]
Ints = NDArray[np.int32]

SHORTEST_MM = 1e-9
"""Length by which a stripe of one point is divided."""


def segments_of(points: NDArray[np.void], gap_mm: float, longest_mm: float) -> tuple[Ints, Ints]:
    """Divide stripes into segments.

    A piece of stripe continues while consecutive points, in the order of `source`, are at most `gap_mm` apart in the
    laser plane. A piece longer than `longest_mm` is divided into segments of equal length.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, mm, coordinates finite, in any order

    Returns
    -------
    segment : (N,) int32, the number of each point's segment, from 0 without gaps
    place : (N,) int32, the place of each point from the nearer end of its piece: 0 for the first and the last point

    Examples
    --------
    >>> from footscan.cloud.points import make_points
    >>> yz = np.array([[0.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 9.0, 0.0]])
    >>> segment, place = segments_of(make_points(yz, camera=1, source=np.arange(4)), gap_mm=1.0, longest_mm=10.0)
    >>> segment.tolist(), place.tolist()
    ([0, 0, 0, 1], [0, 1, 0, 0])
    """
    camera, frame, source, y, z = (points[name].copy() for name in ("camera", "frame", "source", "y", "z"))
    if _is_sorted(camera, frame, source):
        return _number(camera, frame, y, z, gap_mm, longest_mm)
    order = np.lexsort((source, frame, camera))
    segment, place = np.empty(len(points), np.int32), np.empty(len(points), np.int32)
    segment[order], place[order] = _number(camera[order], frame[order], y[order], z[order], gap_mm, longest_mm)
    return segment, place


@compiled
def _is_sorted(camera: NDArray[np.uint8], frame: NDArray[np.int32], source: NDArray[np.int32]) -> bool:
    """True if points are sorted by camera, frame and source."""
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
    """Number the segments of points that are sorted along the stripe; segments and places as in `segments_of`."""
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
            segment[m] = segments + min(int(parts * along[m] / max(along[n - 1], SHORTEST_MM)), parts - 1)
            place[m] = min(m - start, n - 1 - m)
        segments += parts
        start = n
    return segment, place

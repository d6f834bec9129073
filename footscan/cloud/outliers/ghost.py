"""Ghosts: light that both faces of the plate have reflected shows the sole a second time, a constant distance higher.

A camera below the glass sees each point of the foot again, weaker, as if it were about one thickness of the plate
farther away. The ghosts of all cameras below agree with each other, so that none denies those of another.
"""

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.outliers.segments import segments_of
from footscan.cloud.views import View
from footscan.compiled import compiled
from footscan.side_by_side import together

Floats = NDArray[np.float64]

LEAST_MM, MOST_MM, BIN_MM = 2.0, 22.0, 0.25
"""Distances in height between two points of one stripe that are counted, and the width of their classes. Plates are 4
to 20 mm thick."""
BINS = round((MOST_MM - LEAST_MM) / BIN_MM)
BESIDE_MM = 0.7
"""Largest distance in Y between a point and its ghost. Chosen by hand."""
SURROUNDINGS = (4, 12)
"""Classes on either side with which a class is compared, from and to. Chosen by hand."""
PROMINENT = 2.0
"""A camera has ghosts if one distance is so many times as frequent as those around it. Sides of a foot, and toes above
each other, reach 1.6 on films of 24 drawn worlds; ghosts 2.4 to 7.4."""
LEAST_SHARE = 0.02
"""... and if this share of its points has that distance. Chosen by hand."""
NEAR_MM = 0.75
"""Largest deviation from the distance of a ghost. Chosen by hand."""
MAJORITY = 0.5
"""Share of the points of a segment of stripe that decides. Chosen by hand."""


def is_ghost(
    points: NDArray[np.void], views: Mapping[int, View], gap_mm: float, segment_mm: float
) -> NDArray[np.bool_]:
    """Select ghosts of the sole in the plate.

    For each camera below the glass, the distances in height of all points above others of the same stripe are counted.
    The distance of a ghost is the same everywhere, and stands out.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, mm, scanner frame, all finite
    views : camera -> view, mm
    gap_mm, segment_mm : of the segments that are judged, as in `segments_of`

    Returns
    -------
    (N,) bool.
    """
    ghost = np.zeros(len(points), np.bool_)

    def of_camera(camera: int) -> None:
        own = np.flatnonzero(points["camera"] == camera)
        own = own[np.argsort(points["frame"][own], kind="stable")]
        frame, y, z = points["frame"][own], points["y"][own].astype(np.float64), points["z"][own].astype(np.float64)
        distance = _distance(_look_up(frame, y, z, np.inf)[0], len(own))
        if distance is None:
            return
        segment, _ = segments_of(points.take(own), gap_mm, segment_mm)
        _, above = _look_up(frame, y, z, distance)
        ghost[own] = (np.bincount(segment, above) > MAJORITY * np.bincount(segment))[segment]

    cameras = views.keys() & set(np.unique(points["camera"]).tolist())
    together(partial(of_camera, camera) for camera in cameras if views[camera].centre[2] < 0)
    return ghost


def _distance(counts: NDArray[np.int64], points: int) -> float | None:
    """The distance in mm that stands out among the `counts` of distances; None if there is none."""
    three = np.convolve(counts, np.ones(3), "same")
    first, last = SURROUNDINGS
    best, found = PROMINENT, None
    for k in range(2 * first, BINS - first):
        around = np.concatenate([three[max(k - last, 0) : k - first + 1], three[k + first : k + last + 1]])
        prominence = three[k] / max(float(np.median(around)), LEAST_SHARE * points / PROMINENT)
        if three[k] >= LEAST_SHARE * points and prominence > best:
            best, found = prominence, LEAST_MM + (k + 0.5) * BIN_MM
    return found


@compiled
def _look_up(
    frame: NDArray[np.int32], y: Floats, z: Floats, distance: float
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Compare each point with the others of its frame; `frame` (N,) ascending.

    Returns
    -------
    counts : (BINS,) the number of points with another one above them, by the distance in height.
    above : (N,) True for points that lie above another one by `distance`.
    """
    counts, latest = np.zeros(BINS, np.int64), np.full(BINS, -1, np.int64)
    above = np.zeros(len(frame), np.bool_)
    first = 0
    for n in range(len(frame)):
        while frame[first] != frame[n]:
            first += 1
        m = first
        while m < len(frame) and frame[m] == frame[n]:
            height = z[m] - z[n]
            if height > 0.0 and abs(y[m] - y[n]) <= BESIDE_MM:
                above[m] |= abs(height - distance) <= NEAR_MM
                k = int((height - LEAST_MM) / BIN_MM)
                if LEAST_MM <= height < MOST_MM and latest[k] != n:
                    latest[k] = n
                    counts[k] += 1
            m += 1
    return counts, above

"""Which laser made each stripe point, by the cameras that agree with it in each laser plane.

Where two laser planes are millimetres apart, a camera sees two stripes on one skin. The stripe of the other head is
mapped as if it lay in the plane of the camera's own head, which displaces it. Each camera looks from elsewhere, so
stripes that are mapped in the plane in which they lie coincide, and displaced ones do not: a point is assigned to the
laser in whose plane more cameras saw it in the same frame. With rolling shutters the cameras see it at different
moments of the frame, between which the stripe moves on.
"""

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.models.laser_plane import x_in_turned_plane
from footscan.cloud.lasers.moments import ahead_of_frames, late_rows, motion, plane_of_travel, travel_of
from footscan.cloud.points import camera_numbers, coordinates
from footscan.cloud.views import View
from footscan.compiled import compiled
from footscan.side_by_side import together

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

LEAST_MM = 0.15
"""Distance in X between two planes from which a stripe of the other one is displaced more than by noise. Tuned on the
points of three assembled scanners without pictures (`draw_assembled`, seeds 402, 403, 405)."""
FARTHEST_MM = 20.0
"""Distance in X beyond which a camera does not see the other stripe beside its own one: heads that travel one after the
other. Chosen by hand."""
AGREE_MM = 0.1
"""Distance, as a standard deviation, between the stripes of two cameras on one skin. Chosen by hand."""
BETTER = 0.25
"""A point is of another laser if its support there exceeds that in its own plane by this many cameras. Chosen by
hand."""
LINKED_MM = 1.0
"""Distance up to which successive points are of one stripe; they are sampled every 0.3 mm. Chosen by hand."""
SMOOTHED = 20
"""Points on each side of a point along its stripe whose support counts as its own: 6 mm. Tuned as `LEAST_MM`; 10 and 40
serve nearly as well."""
ROUNDS = 3
"""Rounds of assignment; from the second on, only points of a laser support others of it. Chosen by hand."""
SLOPE_ERROR = 0.5
"""Standard deviation of that way, as a share of it: the next stripe may be that of another head. Values from 0.25 to 1
serve as well on the points that `LEAST_MM` was tuned on."""
CELL_MM, CELLS = 1.0, 512
"""Cells in which neighbours are searched, a side. Those beyond are folded back: it costs time, no correctness."""


class LasersSeen(NamedTuple):
    """The laser of each of N points."""

    own: Ints
    """(N,) index of the head that carries the point's camera"""
    laser: Ints
    """(N,) index of the head whose laser made it"""
    supports: Floats
    """(H, N) number of other cameras that saw the point, if it is of the laser of each head"""
    places: Floats
    """(H, N, 3) mm, in the plane of each head; NaN where it is not known"""
    planes: Floats
    """(H, N) X of each plane in the frame of the point, mm; NaN if it is not known"""
    linked: Mask
    """(N,) whether the point and the next one are of one stripe"""


def lasers_seen(points: NDArray[np.void], views: Mapping[int, View], heads: Mapping[int, int]) -> LasersSeen:
    """Assign points to lasers by the cameras that agree with them in each plane.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, by frame, camera and source; with the frames of `renumbered`
    heads : camera -> number of its head, of all cameras; indices are by ascending number
    """
    numbers = sorted(set(heads.values()))
    own: Ints = np.array([numbers.index(heads[number]) for number in points["camera"].tolist()], np.int64)
    ahead = ahead_of_frames(points, views)
    planes = _planes_by_frame(points, own, len(numbers)) if ahead is None else _planes_at_once(points, views, heads)
    places = np.full((len(numbers), len(points), 3), np.nan)
    apart = np.full((len(numbers), len(points)), np.inf)
    for camera, view in views.items():
        rows = np.flatnonzero(points["camera"] == camera)
        for number, head in enumerate(numbers):
            if len(rows):
                other = views[next(one for one in heads if heads[one] == head)]
                places[number, rows], apart[number, rows] = _in_plane(
                    points.take(rows), view, other, planes[number, rows]
                )
    linked = _linked(points)
    ends = np.diff(points["frame"], prepend=points["frame"][0] - 1, append=points["frame"][-1] + 1)
    frames = np.flatnonzero(ends)
    laser = own.copy()
    seen_by = camera_numbers(points)
    support = np.zeros((len(numbers), len(points)))
    late = late_rows(points, views) + (0.0 if ahead is None else ahead)
    moved = late[:, None] * motion(points, late)
    spread = SLOPE_ERROR * np.linalg.norm(moved, axis=1)

    def support_in(place: Floats, counts: Mask) -> Floats:
        return smoothed(_support(place[:, 1:] - moved, seen_by, counts, linked, frames, spread), linked)

    for turn in range(ROUNDS):
        counts = [np.isfinite(place[:, 0]) & ((laser == n) | (turn == 0)) for n, place in enumerate(places)]
        support = np.array(
            together(partial(support_in, place, count) for place, count in zip(places, counts, strict=True))
        )
        at_own = np.take_along_axis(support, own[None], axis=0)[0]
        may_be = np.where((apart > LEAST_MM) & (apart < FARTHEST_MM), support - BETTER, -np.inf)
        best = np.argmax(may_be, axis=0)
        laser = np.where(np.take_along_axis(may_be, best[None], axis=0)[0] > at_own, best, own)
    return LasersSeen(own, laser, support, places, planes, linked)


def _planes_at_once(points: NDArray[np.void], views: Mapping[int, View], heads: Mapping[int, int]) -> Floats:
    """X of the laser plane of each head when each point was seen, (heads, N) mm, if all heads are at one place then."""
    x = travel_of(points, views)
    numbers = sorted(set(heads.values()))
    views_of_heads = [views[next(one for one in heads if heads[one] == number)] for number in numbers]
    return np.array([plane_of_travel(view, x) for view in views_of_heads])


def _planes_by_frame(points: NDArray[np.void], own: Ints, heads: int) -> Floats:
    """X of the laser plane of each head in the frame of each point, (heads, N) mm; NaN if it is not known."""
    frame = points["frame"] - points["frame"][0]
    count = int(frame[-1]) + 1
    by_frame = np.full((heads, count), np.nan)
    for number in range(heads):
        of_head = own == number
        by_frame[number, frame[of_head]] = points["plane"][of_head]
    planes = np.full((heads, len(points)), np.nan)
    for number in range(heads):
        for head in range(heads):
            both = by_frame[number] - by_frame[head]
            if np.isfinite(both).any():  # heads that travel together are always about as far apart
                way = np.where(np.isfinite(both), both, np.nanmedian(both))
                rows = own == head
                planes[number, rows] = points["plane"][rows] + way[frame[rows]]
    return planes


def _in_plane(points: NDArray[np.void], view: View, other: View, plane_x: Floats) -> tuple[Floats, Floats]:
    """Places of points (N,) if they were seen in the plane of another head, (N, 3) mm, and how far the two planes are
    apart there along X, (N,) mm."""
    assert view.plane is not None
    assert other.plane is not None
    xyz, x = coordinates(points), points["plane"].astype(np.float64)
    apart = x_in_turned_plane(other.plane, plane_x, xyz[:, 1:]) - x_in_turned_plane(view.plane, x, xyz[:, 1:])
    sight = view.centre - np.column_stack([np.zeros(len(x)), xyz[:, 1:]])
    yz = xyz[:, 1:] + (apart / sight[:, 0])[:, None] * sight[:, 1:]
    return np.column_stack([x_in_turned_plane(other.plane, plane_x, yz), yz]), np.abs(apart)


def _linked(points: NDArray[np.void]) -> Mask:
    """Whether each point and the next one are of one stripe, (N,)."""
    gap = np.hypot(np.diff(points["y"]), np.diff(points["z"]))
    same = (np.diff(points["frame"]) == 0) & (np.diff(points["camera"].astype(np.int64)) == 0)
    return np.append(same & (gap < LINKED_MM), False)


def stripe_numbers(linked: Mask) -> Ints:
    """The number of the stripe of each point, (N,)."""
    return np.concatenate([[0], np.cumsum(~linked[:-1])])


def smoothed(support: Floats, linked: Mask) -> Floats:
    """The mean (N,) over neighbours along the stripe."""
    number = np.arange(len(support))
    ends = np.append(np.flatnonzero(~linked[:-1]), len(support) - 1)  # the last point of each stripe
    stripe = stripe_numbers(linked)
    first = np.maximum(number - SMOOTHED, np.append(0, ends + 1)[stripe])
    beyond = np.minimum(number + SMOOTHED, ends[stripe]) + 1
    total = np.append(0.0, np.cumsum(support))
    return np.asarray((total[beyond] - total[first]) / (beyond - first))


@compiled
def _support(places: Floats, camera: Ints, counts: Mask, linked: Mask, frames: Ints, spread: Floats) -> Floats:
    """How many other cameras saw each place (N, 2) in its frame; a camera counts less the farther its stripe is.

    Of those points only that count; `frames` (F + 1,) bounds the frames. `spread`, (N,) mm, is the standard deviation
    of a place, beside that by which cameras agree.
    """
    support = np.zeros(len(places))
    nearest = np.empty(int(camera.max()) + 1)
    first, following = np.full((CELLS, CELLS), -1), np.full(len(places), -1)
    for f in range(len(frames) - 1):
        for k in range(frames[f], frames[f + 1]):
            if counts[k]:
                a, b = int(places[k, 0] // CELL_MM) % CELLS, int(places[k, 1] // CELL_MM) % CELLS
                following[k], first[a, b] = first[a, b], k
        for k in range(frames[f], frames[f + 1]):
            if not np.isnan(places[k, 0]):
                _find_nearest(places, k, (camera, linked, counts), (first, following), spread, nearest)
                for squared in nearest:
                    support[k] += np.exp(-0.5 * squared)
        for k in range(frames[f], frames[f + 1]):
            if counts[k]:
                first[int(places[k, 0] // CELL_MM) % CELLS, int(places[k, 1] // CELL_MM) % CELLS] = -1
    return support


@compiled
def _find_nearest(
    places: Floats,
    k: int,
    columns: tuple[Ints, Mask, Mask],
    cells: tuple[Ints, Ints],
    spread: Floats,
    nearest: Floats,
) -> None:
    """Fill `nearest` (C,) with the squared distance of place k from the stripe of each other camera, in its sigmas.

    It is infinite where it is more than a cell.
    """
    camera, linked, counts = columns
    first, following = cells
    nearest[:] = np.inf
    a, b = int(places[k, 0] // CELL_MM), int(places[k, 1] // CELL_MM)
    for da in range(-1, 2):
        for db in range(-1, 2):
            n = first[(a + da) % CELLS, (b + db) % CELLS]
            while n >= 0:
                if camera[n] != camera[k]:
                    squared = _squared_distance(places, k, n, linked[n] and counts[n + 1])
                    if squared < CELL_MM**2:
                        variance = AGREE_MM**2 + spread[k] ** 2 + spread[n] ** 2
                        nearest[camera[n]] = min(nearest[camera[n]], squared / variance)
                n = following[n]


@compiled
def _squared_distance(places: Floats, k: int, n: int, to_next: bool) -> float:
    """Of place k from place n, or from the line between n and the next one."""
    y, z = places[k, 0] - places[n, 0], places[k, 1] - places[n, 1]
    if to_next:
        v, w = places[n + 1, 0] - places[n, 0], places[n + 1, 1] - places[n, 1]
        length = v * v + w * w
        if length > 0.0:
            share = min(max((y * v + z * w) / length, 0.0), 1.0)
            y, z = y - share * v, z - share * w
    return float(y * y + z * z)

"""Points of another head's laser: where two laser planes are millimetres apart, a camera sees two stripes on one skin.

The stripe of the other head is mapped as if it lay in the plane of the camera's own head, which displaces it. Each
camera looks from elsewhere, so stripes that are mapped in the plane in which they lie coincide, and displaced ones do
not: a point is assigned to the laser in whose plane more cameras saw it in the same frame. With rolling shutters the
cameras see it at different moments of the frame, between which the stripe moves on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.calibration.models.laser_plane import x_in_turned_plane
from footscan.cloud.outliers.moments import (
    ahead_of_frames,
    late_rows,
    motion,
    plane_of_travel,
    renumbered,
    travel_of,
)
from footscan.cloud.points import camera_numbers, coordinates
from footscan.cloud.views import View
from footscan.compiled import compiled
from footscan.side_by_side import together
from schemas.calibration import LaserPlane, laser_of_view, view_number

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
CONFIRMED = 0.25
"""Support, in cameras, from which a point is confirmed. Chosen by hand."""
AROUND_MM, FEWEST = 2.5, 8
"""Points within this distance make the skin at a place, if they are so many. Chosen by hand."""
BROAD = 0.2
"""Ratio of the extents of those points from which they make a plane, and not a line. Chosen by hand."""
CLOSE = 0.3
"""A point that no other camera confirms is of another laser if it is brought this near to the skin, in units of the way
that it is moved. Chosen by hand."""
AT_ONCE = 8192
"""Places whose surroundings are in the memory at once, some 20 MB: a bound of space."""
LINKED_MM = 1.0
"""Distance up to which successive points are of one stripe; they are sampled every 0.3 mm. Chosen by hand."""
FEWEST_AT_END = 20
"""Confirmed points that make an end of the skin along the travel. Chosen by hand."""
EXTRAPOLATED = 0.15
"""Largest usual error of an end of the foot that is extrapolated, in mm per mm. Chosen by hand."""
FEW = 0.1
"""Share of the points of another head below which a head has not met the skin yet, or no longer. Chosen by hand."""
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


def is_of_other_laser(points: NDArray[np.void], views: Mapping[int, View]) -> Mask:
    """Select the points (N,) of `POINT_DTYPE` that are stripes of another head's laser.

    A point that no other camera confirms is of the laser of most points of its stripe, or of another head if hardly
    anything is confirmed of its own one in this frame. Where that says nothing, it is selected if it lies on the skin
    that the confirmed points make in the plane of the other laser, and off it in its own one, or if it lies beyond all
    confirmed ones along the travel. Cameras whose calibration does not say where their laser plane lies are left as
    they are, unless the construction of a head says how far apart two lasers are.
    """
    strange = np.zeros(len(points), np.bool_)
    views = _with_planes(views)
    heads = {number: _sheet(number, view.plane.head) for number, view in views.items() if view.plane is not None}
    known = np.flatnonzero(np.isin(points["camera"], list(heads)))
    if len(set(heads.values())) < 2 or not len(known):
        return strange
    of_moment = renumbered(points[known], views)
    order = np.lexsort([of_moment[name] for name in ("source", "camera", "frame")])
    strange[known[order]] = _assigned(of_moment[order], views, heads)
    return strange


def _with_planes(views: Mapping[int, View]) -> Mapping[int, View]:
    """The views; where no film has shown a plane, but one is ahead by construction, all heads count as aligned."""
    if any(view.plane is not None for view in views.values()) or not any(view.ahead_mm for view in views.values()):
        return views
    return {number: replace(view, plane=LaserPlane(head=1, sd=[0.0] * 7)) for number, view in views.items()}


def _sheet(number: int, head: int) -> int:
    """Number the laser plane of view `number`: a head may have two, which are as different as those of two heads."""
    return view_number(head, laser_of_view(number))


class LasersSeen(NamedTuple):
    """The laser of each of N points."""

    own: Ints
    """(N,) index of the head that carries the point's camera"""
    laser: Ints
    """(N,) index of the head whose laser made it"""
    support: Floats
    """(N,) number of other cameras that saw the point, if it is of the laser of its own head"""
    places: Floats
    """(H, N, 2) Y and Z in the plane of each head, mm"""
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
    places = np.full((len(numbers), len(points), 2), np.nan)
    apart = np.full((len(numbers), len(points)), np.inf)
    for camera, view in views.items():
        rows = np.flatnonzero(points["camera"] == camera)
        for number, head in enumerate(numbers):
            if len(rows):
                other = views[next(one for one in heads if heads[one] == head)]
                places[number, rows], apart[number, rows] = _in_plane(points[rows], view, other, planes[number, rows])
    linked = _linked(points)
    ends = np.diff(points["frame"], prepend=points["frame"][0] - 1, append=points["frame"][-1] + 1)
    frames = np.flatnonzero(ends)
    laser = own.copy()
    seen_by = camera_numbers(points)
    at_own = np.zeros(len(points))
    late = late_rows(points, views) + (0.0 if ahead is None else ahead)
    moved = late[:, None] * motion(points, late)
    spread = SLOPE_ERROR * np.linalg.norm(moved, axis=1)

    def support_in(place: Floats, counts: Mask) -> Floats:
        return smoothed(_support(place, seen_by, counts, linked, frames, spread), linked)

    for turn in range(ROUNDS):
        counts = [np.isfinite(place[:, 0]) & ((laser == n) | (turn == 0)) for n, place in enumerate(places)]
        support = np.array(
            together(partial(support_in, place - moved, count) for place, count in zip(places, counts, strict=True))
        )
        at_own = np.take_along_axis(support, own[None], axis=0)[0]
        may_be = np.where((apart > LEAST_MM) & (apart < FARTHEST_MM), support - BETTER, -np.inf)
        best = np.argmax(may_be, axis=0)
        laser = np.where(np.take_along_axis(may_be, best[None], axis=0)[0] > at_own, best, own)
    return LasersSeen(own, laser, at_own, places, planes, linked)


def _assigned(points: NDArray[np.void], views: Mapping[int, View], heads: Mapping[int, int]) -> Mask:
    """Select the points of other lasers, of points by frame, camera and source."""
    own, laser, at_own, places, planes, linked = lasers_seen(points, views, heads)
    strange = np.asarray(laser != own)
    decided = strange | (at_own > CONFIRMED)
    strange |= ~decided & _vote(strange, decided, linked)
    strange |= _not_yet_met(points, own, decided & ~strange)
    decided |= strange
    confirmed = decided & ~strange
    strange |= ~decided & _beyond_ends(points, own, confirmed, planes)
    return strange | _met_other_laser(points, np.flatnonzero(~decided & ~strange), confirmed, places, planes)


def _vote(strange: Mask, decided: Mask, linked: Mask) -> Mask:
    """What most of the points (N,) that are decided say of the stripe of each point; false where none says anything."""
    stripe = np.concatenate([[0], np.cumsum(~linked[:-1])])
    most = 2 * np.bincount(stripe, strange & decided) > np.bincount(stripe, decided)
    return np.asarray(most[stripe])


def _not_yet_met(points: NDArray[np.void], head: Ints, confirmed: Mask) -> Mask:
    """Select the points (N,) of frames in which hardly a point of their head is confirmed, but many of another are.

    Heads of which hardly a frame is confirmed have too few cameras to say so.
    """
    frame = points["frame"] - points["frame"][0]
    counts = np.zeros((int(head.max()) + 1, int(frame[-1]) + 1))
    np.add.at(counts, (head[confirmed], frame[confirmed]), 1.0)
    filled = counts > 0.0
    says = filled.sum(axis=1) > 0.5 * filled.any(axis=0).sum()
    few = (counts < FEW * counts.max(axis=0)) & says[:, None]
    return np.asarray(few[head, frame])


def _beyond_ends(points: NDArray[np.void], head: Ints, confirmed: Mask, planes: Floats) -> Mask:
    """Select the points (N,) that lie beyond the first or the last confirmed place along the travel, and are worth less
    than an end that is extrapolated: planes (H, N) of other heads are far from theirs.

    The first stripes on a heel or on toes are often those of one laser, seen by the cameras of all heads. Points of
    heads of which hardly any is confirmed, as with a single camera, are not selected.
    """
    x = np.sort(points["x"][confirmed])
    if len(x) < 2 * FEWEST_AT_END:
        return np.zeros(len(points), np.bool_)
    beyond = np.maximum(x[FEWEST_AT_END - 1] - points["x"], points["x"] - x[-FEWEST_AT_END])
    way = np.nan_to_num(np.abs(planes - points["plane"]))
    doubt = np.where(way < FARTHEST_MM, way, 0.0).max(axis=0)
    counts = np.bincount(head[confirmed], minlength=int(head.max()) + 1)
    says = counts > FEW * counts.max()
    return np.asarray((beyond > 0.0) & (doubt > np.maximum(LEAST_MM, EXTRAPOLATED * beyond)) & says[head])


def _met_other_laser(
    points: NDArray[np.void], doubtful: NDArray[np.intp], confirmed: Mask, places: Floats, planes: Floats
) -> Mask:
    """Select those of the `doubtful` points that lie on the skin if they are of another laser, and off it if not.

    confirmed : (N,) points that make the skin. places, planes : of each point in the plane of each head
    """
    strange = np.zeros(len(points), np.bool_)
    if not confirmed.any() or not doubtful.size:
        return strange
    xyz = coordinates(points)
    skin = KDTree(xyz[confirmed])
    own = _heights(skin, xyz[doubtful])
    for head_places, plane in zip(places, planes, strict=True):
        x = xyz[doubtful, 0] + plane[doubtful] - points["plane"][doubtful]
        there = np.column_stack([x, head_places[doubtful]])
        way = np.linalg.norm(there - xyz[doubtful], axis=1)
        known = (way > LEAST_MM) & (way < FARTHEST_MM)  # false for NaN
        height = np.full(len(doubtful), np.inf)
        height[known] = _heights(skin, there[known])
        strange[doubtful] |= (height < CLOSE * way) & (height < own)
    return strange


def _heights(skin: KDTree, places: Floats) -> Floats:
    """Distances (N,) of places (N, 3) from the plane through the points around them; infinite where there are few."""
    starts = range(0, len(places), AT_ONCE)
    pieces = together(partial(_heights_of_few, skin, places[start : start + AT_ONCE]) for start in starts)
    return np.concatenate([np.zeros(0), *pieces])


def _heights_of_few(skin: KDTree, places: Floats) -> Floats:
    heights = np.full(len(places), np.inf)
    near: Sequence[list[int]] = np.asarray(skin.query_ball_point(places, AROUND_MM), np.object_).tolist()
    counts = np.array([len(one) for one in near], np.intp)
    rows = np.flatnonzero(counts >= FEWEST)
    if not rows.size:
        return heights
    counts = counts[rows]
    starts = np.cumsum(counts) - counts
    # From the place itself, so that moments of second order lose no digits.
    away = skin.data[np.concatenate([near[row] for row in rows.tolist()])] - np.repeat(places[rows], counts, axis=0)
    middle = np.add.reduceat(away, starts) / counts[:, None]
    away -= np.repeat(middle, counts, axis=0)
    squares = np.add.reduceat(away[:, :, None] * away[:, None, :], starts)
    extents, axes = np.linalg.eigh(squares)
    is_broad = extents[:, 1] > BROAD**2 * extents[:, 2]
    height = np.abs(np.einsum("ni,ni->n", middle, axes[:, :, 0]))
    heights[rows] = np.where(is_broad, height, np.inf)
    return heights


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
    """Y and Z of points (N,) if they were seen in the plane of another head, (N, 2) mm, and how far the two planes are
    apart there along X, (N,) mm."""
    assert view.plane is not None
    assert other.plane is not None
    xyz, x = coordinates(points), points["plane"].astype(np.float64)
    apart = x_in_turned_plane(other.plane, plane_x, xyz[:, 1:]) - x_in_turned_plane(view.plane, x, xyz[:, 1:])
    sight = view.centre - np.column_stack([np.zeros(len(x)), xyz[:, 1:]])
    return xyz[:, 1:] + (apart / sight[:, 0])[:, None] * sight[:, 1:], np.abs(apart)


def _linked(points: NDArray[np.void]) -> Mask:
    """Whether each point and the next one are of one stripe, (N,)."""
    gap = np.hypot(np.diff(points["y"]), np.diff(points["z"]))
    same = (np.diff(points["frame"]) == 0) & (np.diff(points["camera"].astype(np.int64)) == 0)
    return np.append(same & (gap < LINKED_MM), False)


def smoothed(support: Floats, linked: Mask) -> Floats:
    """The mean (N,) over neighbours along the stripe."""
    number = np.arange(len(support))
    ends = np.append(np.flatnonzero(~linked[:-1]), len(support) - 1)  # the last point of each stripe
    stripe = np.searchsorted(ends, number)
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

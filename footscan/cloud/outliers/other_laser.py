"""Points of another head's laser, which a camera sees beside its own stripe where two planes are millimetres apart."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.cloud.lasers.moments import renumbered
from footscan.cloud.lasers.seen import BETTER, FARTHEST_MM, LEAST_MM, lasers_seen, stripe_numbers
from footscan.cloud.outliers.contested import LEG_MM, ends_of
from footscan.cloud.outliers.heel_cap import FIT_MM, is_off_cap
from footscan.cloud.points import coordinates, stripe_step
from footscan.cloud.views import View
from footscan.side_by_side import together
from schemas.calibration import LaserPlane, laser_of_view, view_number

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

CONFIRMED = 0.25
"""Support, in cameras, from which a point is confirmed. Chosen by hand."""
SURE = 0.75
"""Support, in cameras, that a point of a stripe must have for the stripe to make an end of the foot: there cameras of
two heads that see one laser meet in the plane of the other by chance. Tuned on a scanner without pictures
(`draw_assembled`, seed 4134), where two cameras whose points are off by 1.5 mm confirm each other by 0.1 to 0.66."""
AROUND_MM, FEWEST = 2.5, 8
"""Points within this distance make the skin at a place, if they are so many. Chosen by hand."""
BROAD = 0.2
"""Ratio of the extents of those points from which they make a plane, and not a line. Chosen by hand."""
CLOSE = 0.3
"""A point that no other camera confirms is of another laser if it is brought this near to the skin, in units of the way
that it is moved. Chosen by hand."""
AT_ONCE = 8192
"""Places whose surroundings are in the memory at once, some 20 MB: a bound of space."""
FEWEST_AT_END = 20
"""Confirmed points that make an end of the skin along the travel. Chosen by hand."""
STRIP_MM, BESIDE_MM = 1.0, 4.0
"""Breadth of the strips along the travel that have ends of their own, and how far beside a strip points make its ends:
together less than a small toe. Chosen by hand."""
EXTRAPOLATED = 0.15
"""Largest usual error of an end of the foot that is extrapolated, in mm per mm. Chosen by hand."""
FEW = 0.1
"""Share of the points of another head below which a head has not met the skin yet, or no longer. Chosen by hand."""
MOST = 0.5
"""Share of a head's confirmed points in a frame that must be certain. Chosen by hand: on the feet of four assembled
scanners (seeds 1004, 2022 to 2024) it is 0.34 in the one frame that is mistaken, and above 0.6 in all others."""


def is_of_other_laser(points: NDArray[np.void], views: Mapping[int, View]) -> Mask:
    """Select the points (N,) of `POINT_DTYPE` that are stripes of another head's laser.

    A point that no other camera confirms is of the laser of most points of its stripe, or of another head if hardly
    anything is confirmed of its own one in this frame. Where that says nothing, it is selected if it lies on the skin
    that the confirmed points make in the plane of the other laser, and off it in its own one. Stripes on which cameras
    hardly agree are selected beyond the end of the heel, or of their toe, and stripes off the cap of a heel always.
    Cameras whose calibration does not say where their laser plane lies are left as they are, unless the construction of
    a head says how far apart two lasers are.
    """
    return _selected(points, views, _assigned)


def is_off_heel(points: NDArray[np.void], views: Mapping[int, View]) -> Mask:
    """Select the points (N,) of `POINT_DTYPE` of other lasers' stripes on a heel whose movement was taken back.

    Lasers are looked for at both ends alone: which one is the heel is not known, and the whole foot takes longer.
    """
    off, low = np.zeros(len(points), np.bool_), points["z"] < LEG_MM
    if np.count_nonzero(low) > FEWEST_AT_END:
        first, last = ends_of(points["x"][low], FEWEST_AT_END)
        at_end = np.flatnonzero(low & ((points["x"] < first + FIT_MM) | (points["x"] > last - FIT_MM)))
        off[at_end] = _selected(points.take(at_end), views, _off_cap)
    return off


def _selected(
    points: NDArray[np.void],
    views: Mapping[int, View],
    select: Callable[[NDArray[np.void], Mapping[int, View], Mapping[int, int]], Mask],
) -> Mask:
    """What is selected of those points (N,) whose laser planes are known, by frame, camera and source."""
    strange = np.zeros(len(points), np.bool_)
    views = _with_planes(views)
    heads = {number: _sheet(number, view.plane.head) for number, view in views.items() if view.plane is not None}
    known = np.flatnonzero(np.isin(points["camera"], list(heads)))
    if len(set(heads.values())) < 2 or not len(known):
        return strange
    of_moment = renumbered(points.take(known), views)
    order = np.lexsort([of_moment[name] for name in ("source", "camera", "frame")])
    strange[known[order]] = select(of_moment.take(order), views, heads)
    return strange


def _off_cap(points: NDArray[np.void], views: Mapping[int, View], heads: Mapping[int, int]) -> Mask:
    """Select the points of stripes off the cap of a heel, of points by frame, camera and source."""
    seen = lasers_seen(points, views, heads)
    return is_off_cap(coordinates(points), np.ones(len(points), np.bool_), stripe_numbers(seen.linked), seen.places)


def _with_planes(views: Mapping[int, View]) -> Mapping[int, View]:
    """The views; where no film has shown a plane, but one is ahead by construction, all heads count as aligned."""
    if any(view.plane is not None for view in views.values()) or not any(view.ahead_mm for view in views.values()):
        return views
    return {number: replace(view, plane=LaserPlane(head=1, sd=[0.0] * 7)) for number, view in views.items()}


def _sheet(number: int, head: int) -> int:
    """Number the laser plane of view `number`: a head may have two, which are as different as those of two heads."""
    return view_number(head, laser_of_view(number))


def _assigned(points: NDArray[np.void], views: Mapping[int, View], heads: Mapping[int, int]) -> Mask:
    """Select the points of other lasers, of points by frame, camera and source."""
    own, laser, supports, places, planes, linked = lasers_seen(points, views, heads)
    of_head = np.arange(len(supports))[:, None] == own
    at_own = np.where(of_head, supports, 0.0).max(axis=0)
    elsewhere = np.where(of_head, 0.0, supports).max(axis=0)
    strange = np.asarray(laser != own)
    decided = strange | (at_own > CONFIRMED)
    stripe = stripe_numbers(linked)
    strange |= ~decided & _vote(strange, decided, stripe)
    strange |= _not_yet_met(points, own, decided & ~strange, at_own > elsewhere + BETTER)
    decided |= strange
    makes_end = (np.bincount(stripe, at_own > SURE) > 0)[stripe]
    ends = _confirmed_ends(points, own, decided & ~strange & makes_end)
    strange |= ~makes_end & _beyond_ends(points, ends, planes)
    confirmed = decided & ~strange
    doubtful = np.flatnonzero(~decided & ~strange)
    strange |= _met_other_laser(points, doubtful, confirmed, stripe, places, planes, ends)
    strange |= is_off_cap(coordinates(points), ~strange, stripe, places)
    return strange


def _vote(strange: Mask, decided: Mask, stripe: Ints) -> Mask:
    """What most of the points (N,) that are decided say of the stripe of each point; false where none says anything."""
    most = 2 * np.bincount(stripe, strange & decided) > np.bincount(stripe, decided)
    return np.asarray(most[stripe])


def _not_yet_met(points: NDArray[np.void], head: Ints, confirmed: Mask, certain: Mask) -> Mask:
    """Select the points (N,) of frames in which the laser of their head is not on the foot yet, or no longer.

    There hardly a point of the head is confirmed, but many of another are; or its cameras confirm each other in the
    same mistake: most of their points are not `certain`, as they are confirmed in the plane of another laser as well.
    A camera whose own laser is on the foot would see two stripes. Heads of which hardly a frame is confirmed, or
    certain, have too few cameras, or planes too close together, to say so. Some laser made what is seen in a frame: if
    this holds for all heads, as on the blunt tip of a toe, it is that of the head of most confirmed points.
    """
    frame = points["frame"] - points["frame"][0]
    counts, certain_counts = np.zeros((2, int(head.max()) + 1, int(frame[-1]) + 1))
    np.add.at(counts, (head[confirmed], frame[confirmed]), 1.0)
    np.add.at(certain_counts, (head[confirmed & certain], frame[confirmed & certain]), 1.0)
    not_met = np.zeros(counts.shape, np.bool_)
    for doubted in (counts < FEW * counts.max(axis=0), certain_counts < MOST * counts):
        met = (counts > 0.0) & ~doubted
        says = met.sum(axis=1) > 0.5 * counts.any(axis=0).sum()
        not_met |= doubted & says[:, None]
    is_dark = (not_met | (counts == 0.0)).all(axis=0) & counts.any(axis=0)
    not_met[counts.argmax(axis=0)[is_dark], is_dark] = False
    return np.asarray(not_met[head, frame])


def _confirmed_ends(points: NDArray[np.void], head: Ints, confirmed: Mask) -> Floats:
    """X of the first and of the last confirmed place beside each point, (2, N) mm, as each toe has an end of its own;
    infinite for points of heads of which hardly any is confirmed, as with a single camera."""
    ends = np.repeat([[-np.inf], [np.inf]], len(points), axis=1)
    sure = np.flatnonzero(confirmed)
    if len(sure) < 2 * FEWEST_AT_END:
        return ends
    counts = np.bincount(head[sure], minlength=int(head.max()) + 1)
    says = (counts > FEW * counts.max())[head]
    sure = sure[np.argsort(points["y"][sure], kind="stable")]
    x, y = points["x"][sure], points["y"][sure]
    strip = np.floor(points["y"] / STRIP_MM).astype(np.intp)
    strips = np.arange(strip.min(), strip.max() + 1)
    first = np.searchsorted(y, STRIP_MM * strips - BESIDE_MM)
    last = np.searchsorted(y, STRIP_MM * (strips + 1) + BESIDE_MM)
    beside = [x[start:end] for start, end in zip(first, last, strict=True)]
    whole = ends_of(x, FEWEST_AT_END)
    of_strips = np.array([ends_of(one, FEWEST_AT_END) if len(one) >= 2 * FEWEST_AT_END else whole for one in beside])
    ends[:, says] = of_strips[strip[says] - strips[0]].T
    return ends


def _is_beyond(x: Floats, ends: Floats) -> Mask:
    """Whether X (N,) is beyond the `ends` (2, N)."""
    return np.asarray((x < ends[0]) | (x > ends[1]))


def _beyond_ends(points: NDArray[np.void], ends: Floats, planes: Floats) -> Mask:
    """Select the points (N,) that lie beyond the confirmed `ends` (2, N) along the travel, and are worth less than an
    end that is extrapolated: planes (H, N) of other heads are far from theirs.

    The first stripes on a heel or on toes are often those of one laser, seen by the cameras of all heads.
    """
    beyond = np.maximum(ends[0] - points["x"], points["x"] - ends[1])
    way = np.nan_to_num(np.abs(planes - points["plane"]))
    doubt = np.where(way < FARTHEST_MM, way, 0.0).max(axis=0)
    return np.asarray((beyond > 0.0) & (doubt > np.maximum(LEAST_MM, EXTRAPOLATED * beyond)))


def _met_other_laser(
    points: NDArray[np.void],
    doubtful: NDArray[np.intp],
    confirmed: Mask,
    stripe: Ints,
    places: Floats,
    planes: Floats,
    ends: Floats,
) -> Mask:
    """Select those of the `doubtful` points that lie on the skin if they are of another laser, and off it if not.

    Where there is no skin to lie on, the rest of the stripe says it. Of stripes without any confirmed point, 1340
    points were off by more than 0.5 mm and 11 by less than 0.2 mm, of others none and 4712 (`draw_assembled`, seeds
    2060, 2106, 2129, 2143 and 2144). Beyond the ends there is neither: the stripe of another laser on the cap of a
    heel, which cameras of this head alone may see, is selected if it is not on the skin in its own plane.

    confirmed : (N,) points that make the skin. stripe : (N,) number of the stripe of each point.
    places, planes : of each point in the plane of each head. ends : (2, N) X of the first and the last confirmed place;
    infinite for heads whose stripes are hardly ever confirmed
    """
    strange = np.zeros(len(points), np.bool_)
    if not confirmed.any() or not doubtful.size:
        return strange
    xyz = coordinates(points)
    skin = KDTree(xyz[confirmed])
    own = _heights(skin, xyz[doubtful])
    is_between = np.isfinite(ends[0, doubtful]) & ~_is_beyond(xyz[doubtful, 0], ends[:, doubtful])
    is_alone = (np.bincount(stripe, confirmed) == 0.0)[stripe[doubtful]]
    is_alone &= stripe_step(points) < AROUND_MM  # otherwise a stripe without confirmed points has no skin around it
    for head_places, plane in zip(places, planes, strict=True):
        # Without the tilt of the planes: with it, more right points were taken for wrong ones, and hardly a wrong one
        # was found (`draw_assembled`, seeds 7001 to 7004).
        x = xyz[doubtful, 0] + plane[doubtful] - points["plane"][doubtful]
        there = np.column_stack([x, head_places[doubtful, 1:]])
        way = np.linalg.norm(there - xyz[doubtful], axis=1)
        known = (way > LEAST_MM) & (way < FARTHEST_MM)  # false for NaN
        height = np.full(len(doubtful), np.inf)
        height[known] = _heights(skin, there[known])
        strange[doubtful] |= (height < CLOSE * way) & (height < own)
        is_off = (own > CLOSE * way) & _is_beyond(x, ends[:, doubtful])
        strange[doubtful] |= known & is_between & (is_off | (is_alone & np.isinf(own)))
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

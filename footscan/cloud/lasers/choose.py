"""Points of cameras that see two laser planes: in which of the two each point lies.

A stripe in a picture does not say which laser drew it. Mapped by the map of the wrong one, it lies off the skin by
about the distance of the two planes, along the sight of its camera. So every point is mapped by both maps, and the
evidence is what other views show at either place: other cameras that saw the same plane at the same moment, and all
cameras that saw the same X with the other laser, at another moment. Skin is where many views meet; wrong places of
several cameras part, because each looks from elsewhere, and those of the two lasers lie on opposite sides of the skin.

The line whose plane stands ahead lies on one side of the other one in every picture. This needs no rule of its own:
with the two exchanged, the one would lie above the skin and the other below it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.cell_cameras import cameras_around
from footscan.cloud.lasers.seen import LINKED_MM, smoothed, stripe_numbers
from footscan.cloud.points import camera_numbers, coordinates, stripe_step
from footscan.mesh.voxels import voxelise

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

CELL_PART, CELLS_MM = 0.125, (0.5, 2.0)
"""Edge in Y and Z of the cells in which views meet: a part of the distance of the two planes, within bounds in mm.
Points of one piece of skin lie in a cell and its neighbours, those mapped by the wrong map beyond. Chosen by hand."""
LEAST_STEP_MM = 0.5
"""Smallest edge of these cells along the travel; it is that from frame to frame. Chosen by hand."""
BETTER = 0.5
"""Views by which one place must exceed the other one, for a point to be decided by itself. Chosen by hand."""
ROUNDS = 3
"""Rounds of assignment; from the second on, only places that were chosen count as evidence. Chosen by hand."""


@dataclass(frozen=True)
class Choice:
    """Which points are real, of those that were mapped by two maps."""

    other: Mask
    """(N,) True for the place of a stripe point in the plane in which it does not lie."""
    unassigned: Mask
    """(N,) True for the first place of a stripe point whose plane is not known; its second one is in `other`."""


def choose_lasers(points: NDArray[np.void]) -> Choice:
    """Choose the laser of each stripe point of cameras that see two.

    A point is of the laser in whose plane it meets more other views; points that meet as many in both are of the laser
    of the rest of their piece of stripe. Where that says nothing either, a point stays unassigned.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, mm, scanner frame, of all cameras; `camera` is the number of the view, as in
        `schemas.calibration.view_number`. Two points of one camera with the same `source` are the two places of one
        stripe point.
    """
    chosen = np.zeros(len(points), np.bool_)
    first, second = _pairs(points)
    if not len(first):
        return Choice(chosen, chosen.copy())
    linked = _linked(points, first, second)
    cells = _Cells(points, first, second)
    is_single = np.ones(len(points), np.bool_)
    is_single[np.concatenate([first, second])] = False
    counts = np.ones(len(points), np.bool_)
    for _ in range(ROUNDS):
        views = cells.others(counts)
        laser = _decided(smoothed(views[first] - views[second], linked), linked)
        counts = is_single.copy()
        counts[first[laser > 0]] = counts[second[laser < 0]] = True
    other, unassigned = np.zeros(len(points), np.bool_), np.zeros(len(points), np.bool_)
    other[first[laser < 0]] = other[second[laser >= 0]] = True
    unassigned[first[laser == 0]] = True
    return Choice(other, unassigned)


def _pairs(points: NDArray[np.void]) -> tuple[Ints, Ints]:
    """The two places of each stripe point that has two, (P,) each, by camera and source."""
    camera = camera_numbers(points)
    rows = np.flatnonzero(np.isin(camera, camera[points["camera"] != camera]))
    order = rows[np.lexsort([points["camera"][rows], points["source"][rows], camera[rows]])]
    same = (np.diff(camera[order]) == 0) & (np.diff(points["source"][order]) == 0)
    same &= np.diff(points["camera"][order].astype(np.int64)) != 0
    return order[:-1][same], order[1:][same]


def _linked(points: NDArray[np.void], first: Ints, second: Ints) -> Mask:
    """Whether each of P stripe points and the next one are of one piece, in both planes, (P,)."""
    linked = (np.diff(points["frame"][first]) == 0) & (np.diff(points["camera"][first].astype(np.int64)) == 0)
    for place in (first, second):
        linked &= np.hypot(np.diff(points["y"][place]), np.diff(points["z"][place])) < LINKED_MM
    return np.append(linked, False)


def _decided(evidence: Floats, linked: Mask) -> NDArray[np.int8]:
    """The laser of each stripe point (P,): 1 the first one, -1 the second one, 0 unknown."""
    sure = np.abs(evidence) > BETTER
    piece = stripe_numbers(linked)
    of_piece = np.bincount(piece, np.where(sure, np.sign(evidence), 0.0))[piece]
    return np.sign(np.where(sure, evidence, of_piece)).astype(np.int8)


class _Cells:
    """The cells in which views meet."""

    def __init__(self, points: NDArray[np.void], first: Ints, second: Ints) -> None:
        apart = float(np.median(np.abs(points["plane"][second] - points["plane"][first])))
        edge = float(np.clip(CELL_PART * apart, *CELLS_MM))
        xyz = coordinates(points)
        self._usable = np.flatnonzero(points["supported"] & np.isfinite(xyz).all(axis=1))
        """Points elsewhere would only make the grid large."""
        numbers, index = np.unique(points["camera"], return_inverse=True)
        self._bits = np.uint64(1) << index[self._usable].astype(np.uint64)
        self._count, self._views = len(points), len(numbers)
        self._voxels = None
        if self._usable.size:
            step = max(stripe_step(points), LEAST_STEP_MM)
            self._voxels = voxelise(xyz[self._usable], (step, edge, edge))

    def others(self, counts: Mask) -> Floats:
        """Number of other views that meet each point (N,), of the points that count."""
        found = np.zeros(self._count)
        if self._voxels is not None:
            seen = np.zeros(len(self._voxels.place), np.uint64)
            counted = counts[self._usable]
            np.bitwise_or.at(seen, self._voxels.voxel[counted], self._bits[counted])
            near = cameras_around(self._voxels.number, seen, self._voxels.place)[self._voxels.voxel] & ~self._bits
            found[self._usable] = np.bitwise_count(near)
        return found

"""Pieces of the stripe: points that hang together, and which of the pieces are the stripe."""

import math

import numba
import numpy as np
from numpy.typing import NDArray

from footscan.stripe.profile import CENTRE_I, CENTRE_J, CONTRAST, CURVATURE, NORMAL_I, NORMAL_J, WIDTH
from schemas.parameters.extraction import ExtractionParameters

SECTION_PX = 0.5
"""Half thickness in px of the cross-section of a point."""
SHARPER = 4.0
"""How many times as sharp a ridge is as the spurs that noise puts on its shoulders."""
BESIDE_PX = 1.5
"""How far from the normal of a point a point of the stripe beside it may lie."""
LENGTH_TO_WIDTH = 2.0
"""A piece that is not longer than this many widths is a spot."""


def drop_repeated(profiles: NDArray[np.float64], parameters: ExtractionParameters) -> NDArray[np.float64]:
    """The (N, 8) profiles without those that a sharper one beside them explains: the stripe is crossed once."""
    if len(profiles) == 0:
        return profiles
    sharpest: NDArray[np.bool_] = _is_sharpest(profiles, *_grid(profiles, 0.5 * parameters.largest_width_px))
    return profiles[sharpest]


def keep_stripe(profiles: NDArray[np.float64], parameters: ExtractionParameters) -> NDArray[np.bool_]:
    """Which of (N, 8) profiles belong to the stripe: not to spots, to ghosts, or to far and weak reflections."""
    keep = np.ones(len(profiles), np.bool_)
    if len(profiles) == 0:
        return keep
    piece = connect(profiles, parameters.gap_px)
    count = np.bincount(piece)
    width = np.bincount(piece, profiles[:, WIDTH]) / np.maximum(count, 1)
    keep &= (count >= np.maximum(parameters.shortest_piece_px, LENGTH_TO_WIDTH * width))[piece]

    strength = profiles[:, CONTRAST] * profiles[:, WIDTH]
    members = np.flatnonzero(keep)
    if len(members):
        cells = _grid(profiles[members], max(parameters.ghost_reach_px, 1.0))
        beside = np.zeros(len(members), np.bool_)
        for brightness in (
            profiles[:, CONTRAST],
            strength,
        ):  # a saturated stripe is wider, not brighter, than its ghost
            beside |= _is_beside_stronger(
                profiles[members],
                brightness[members],
                parameters.ghost_strength,
                parameters.ghost_reach_px,
                *cells,
            )
        ghosts = np.bincount(piece[members], beside, minlength=len(count))
        keep &= (ghosts <= 0.5 * count)[piece]

    members = np.flatnonzero(keep)
    if len(members):
        group = connect(profiles[members], parameters.group_gap_px)
        total = np.bincount(group, strength[members])
        keep[members] = (total >= parameters.smallest_group * total.max())[group]
    return keep


def connect(profiles: NDArray[np.float64], distance: float) -> NDArray[np.intp]:
    """A number (N,) for each point, the same for points that are linked by steps of at most `distance` px.

    Of `profiles`, only the first two columns count: i and j of the centre, px.
    """
    parent = _link(profiles, distance, *_grid(profiles, distance))
    return np.unique(parent, return_inverse=True)[1]


def _grid(profiles: NDArray[np.float64], side: float) -> tuple[NDArray[np.intp], NDArray[np.intp], int]:
    """Points sorted into square cells: their indices by cell, where each cell begins, and how many cells are in a row.

    A border of empty cells runs around, so that every point's cell has eight neighbours.
    """
    cells = np.floor(profiles[:, [CENTRE_I, CENTRE_J]] / side).astype(np.intp)
    cells -= cells.min(axis=0) - 1
    across, down = cells.max(axis=0) + 2
    number = cells[:, 1] * across + cells[:, 0]
    return np.argsort(number, kind="stable"), np.r_[0, np.cumsum(np.bincount(number, minlength=across * down))], across


@numba.njit(cache=True, nogil=True)
def _cell_of(start: NDArray[np.intp], rank: int) -> int:
    return int(np.searchsorted(start, rank, side="right")) - 1


@numba.njit(cache=True, nogil=True)
def _is_sharpest(
    profiles: NDArray[np.float64], order: NDArray[np.intp], start: NDArray[np.intp], across: int
) -> NDArray[np.bool_]:
    """Which points lie neither in the cross-section of a sharper one nor on its shoulder."""
    sharpest = np.ones(len(profiles), np.bool_)
    for rank in range(len(order)):
        a, cell = order[rank], _cell_of(start, rank)
        for row in (cell - across, cell, cell + across):
            for b in order[start[row - 1] : start[row + 2]]:
                # Of equals, the one that was found first.
                if (profiles[b, CURVATURE], -b) > (profiles[a, CURVATURE], -a):
                    d_i = profiles[a, CENTRE_I] - profiles[b, CENTRE_I]
                    d_j = profiles[a, CENTRE_J] - profiles[b, CENTRE_J]
                    off = abs(d_i * profiles[b, NORMAL_J] - d_j * profiles[b, NORMAL_I])
                    beside = abs(d_i * profiles[b, NORMAL_I] + d_j * profiles[b, NORMAL_J])
                    half = 0.5 * profiles[b, WIDTH]
                    spur = (
                        profiles[b, CURVATURE] > SHARPER * profiles[a, CURVATURE] and math.hypot(d_i, d_j) <= 2 * half
                    )
                    if spur or (off <= SECTION_PX and beside <= half):
                        sharpest[a] = False
    return sharpest


@numba.njit(cache=True, nogil=True)
def _link(
    profiles: NDArray[np.float64], distance: float, order: NDArray[np.intp], start: NDArray[np.intp], across: int
) -> NDArray[np.intp]:
    """The first point of each point's piece."""
    parent = np.arange(len(profiles))
    for rank in range(len(order)):
        a, cell = order[rank], _cell_of(start, rank)
        for row in (cell - across, cell, cell + across):
            for b in order[start[row - 1] : start[row + 2]]:
                if b < a and _distance(profiles[a], profiles[b]) <= distance:
                    root_a, root_b = _root(parent, a), _root(parent, b)
                    parent[max(root_a, root_b)] = min(root_a, root_b)
    for a in range(len(parent)):
        parent[a] = _root(parent, a)
    return parent


@numba.njit(cache=True, nogil=True)
def _root(parent: NDArray[np.intp], a: int) -> int:
    while parent[a] != a:
        parent[a] = parent[parent[a]]
        a = parent[a]
    return a


@numba.njit(cache=True, nogil=True)
def _distance(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    return math.hypot(a[CENTRE_I] - b[CENTRE_I], a[CENTRE_J] - b[CENTRE_J])


@numba.njit(cache=True, nogil=True)
def _is_beside_stronger(
    profiles: NDArray[np.float64],
    strength: NDArray[np.float64],
    part: float,
    reach: float,
    order: NDArray[np.intp],
    start: NDArray[np.intp],
    across: int,
) -> NDArray[np.bool_]:
    """Which points have less than `part` of the strength of another on their normal, within `reach` px."""
    beside = np.zeros(len(profiles), np.bool_)
    for rank in range(len(order)):
        a, cell = order[rank], _cell_of(start, rank)
        normal_i, normal_j = profiles[a, NORMAL_I], profiles[a, NORMAL_J]
        for row in (cell - across, cell, cell + across):
            for b in order[start[row - 1] : start[row + 2]]:
                if strength[a] < part * strength[b]:
                    d_i = profiles[b, CENTRE_I] - profiles[a, CENTRE_I]
                    d_j = profiles[b, CENTRE_J] - profiles[a, CENTRE_J]
                    off = abs(d_i * normal_j - d_j * normal_i)
                    beside[a] |= off <= BESIDE_PX and abs(d_i * normal_i + d_j * normal_j) <= reach
    return beside

"""Selection of the pieces of a frame that are the stripe: no spots, no ghosts, no far and weak reflections."""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.profile import CONTRAST, LIGHT, WIDTH
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, SPACING_PX, I, J

BESIDE_PX = 1.5
"""How far from the normal of a point of a ghost, in px, the corresponding point of the stripe may lie. Chosen by
hand."""
COPY = 0.5
"""Part of the stripe's light, as far as that is not saturated, below which a piece may be a ghost. Chosen by hand."""
APART_PX, APART = 1.0, 0.05
"""Largest standard deviation of a ghost's distance from the stripe: a constant part in px and a part relative to the
mean distance. Chosen by hand."""
LENGTH_TO_WIDTH = 2.0
"""A piece shorter than this many widths is a spot. Chosen by hand."""
MAJORITY = 0.5
"""Share of a piece's points that decides for the piece, and of the shortest length that must be strong. Chosen by
hand."""


@compiled
def keep_stripe(
    profiles: NDArray[np.float64],
    piece: NDArray[np.int32],
    count: int,
    smallest_contrast: float,
    shortest: float,
    ghost_reach: float,
    ghost_strength: float,
    group_gap: float,
    smallest_group: float,
) -> NDArray[np.bool_]:
    """Select the profiles that belong to the stripe.

    Parameters
    ----------
    profiles : (N, 11) float64, in the columns of `measure_profiles`.
    piece : (N,) int32, the piece of each profile, from 0 to `count` - 1.
    smallest_contrast : contrast of a strong point, in levels of the signal (`SIGNAL_SCALE` a grey level).
    shortest, ghost_reach, group_gap : px, as in `ExtractionParameters`.
    ghost_strength, smallest_group : shares, as in `ExtractionParameters`.

    Returns
    -------
    (N,) bool, True for profiles that are kept.
    """
    length, strong, width = np.zeros(count), np.zeros(count), np.zeros(count)
    for a in range(len(profiles)):
        length[piece[a]] += SPACING_PX
        strong[piece[a]] += SPACING_PX * (profiles[a, CONTRAST] >= smallest_contrast)
        width[piece[a]] += SPACING_PX * profiles[a, WIDTH]
    kept = np.empty(count, np.bool_)
    for p in range(count):
        # A piece keeps its faint ends if it is strong elsewhere.
        kept[p] = (
            length[p] >= max(shortest, LENGTH_TO_WIDTH * width[p] / length[p]) and strong[p] >= MAJORITY * shortest
        )
    if kept.sum() > 1:
        _drop_ghosts(profiles, piece, kept, length / SPACING_PX, ghost_reach, ghost_strength)
    if kept.sum() > 1:
        _drop_weak_groups(profiles, piece, kept, group_gap, smallest_group)
    return kept[piece]


@compiled
def _drop_ghosts(
    profiles: NDArray[np.float64],
    piece: NDArray[np.int32],
    kept: NDArray[np.bool_],
    points: NDArray[np.float64],
    reach: float,
    part: float,
) -> None:
    """Drop the ghosts: pieces that mostly run beside a stronger one, with less than `part` of its light or parallel.

    Both the stripe and its ghost may be saturated, so that their true light is not known. But a ghost is a copy: it
    keeps the same distance from the stripe throughout.
    """
    distance, weaker = _beside_stronger(profiles, piece, kept, reach, part)
    for p in range(len(kept)):
        if not kept[p]:
            continue
        own = piece == p
        apart = distance[own & (distance <= reach)]
        parallel = apart.size > MAJORITY * points[p] and apart.std() <= APART_PX + APART * apart.mean()
        if parallel or weaker[own].sum() > MAJORITY * points[p]:
            kept[p] = False


@compiled
def _beside_stronger(
    profiles: NDArray[np.float64], piece: NDArray[np.int32], kept: NDArray[np.bool_], reach: float, part: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Find for each point the points of stronger pieces across the stripe, of which it may be a copy.

    Returns
    -------
    distance : (N,) float64, px, of the nearest one; infinite if there is none.
    weaker : (N,) bool, True if the point has less than `part` of the light of one of them.
    """
    distance, weaker = np.full(len(profiles), math.inf), np.zeros(len(profiles), np.bool_)
    most = 0.0
    for a in range(len(profiles)):
        if kept[piece[a]]:
            most = max(most, profiles[a, LIGHT])
    order, start, across = _grid(profiles, piece, kept, max(reach, 1.0))
    for cell in range(start.size - 1):
        for a in order[start[cell] : start[cell + 1]]:
            light = profiles[a, LIGHT]
            if light >= COPY * most:
                continue
            i, j, normal_i, normal_j = profiles[a, I], profiles[a, J], profiles[a, NORMAL_I], profiles[a, NORMAL_J]
            for row in (cell - across, cell, cell + across):
                for b in order[start[row - 1] : start[row + 2]]:
                    if light >= COPY * profiles[b, LIGHT] or piece[b] == piece[a]:
                        continue
                    d_i, d_j = profiles[b, I] - i, profiles[b, J] - j
                    off = abs(d_i * normal_i + d_j * normal_j)
                    if off <= reach and abs(d_i * normal_j - d_j * normal_i) <= BESIDE_PX:
                        distance[a] = min(distance[a], off)
                        weaker[a] |= light < part * profiles[b, LIGHT]
    return distance, weaker


@compiled
def _drop_weak_groups(
    profiles: NDArray[np.float64], piece: NDArray[np.int32], kept: NDArray[np.bool_], gap: float, smallest: float
) -> None:
    """Drop groups of pieces that lie far from the stripe and have less than `smallest` of its light."""
    count = len(kept)
    order, start, across = _grid(profiles, piece, kept, gap)
    group = np.arange(count)
    groups = kept.sum()
    for cell in range(start.size - 1):
        for a in order[start[cell] : start[cell + 1]]:
            own = _root(group, piece[a])
            for row in (cell - across, cell, cell + across):
                for b in order[start[row - 1] : start[row + 2]]:
                    if group[piece[b]] == own:
                        continue
                    d_i, d_j = profiles[b, I] - profiles[a, I], profiles[b, J] - profiles[a, J]
                    if d_i * d_i + d_j * d_j <= gap * gap:
                        other = _root(group, piece[b])
                        if other != own:
                            group[max(own, other)] = own = min(own, other)
                            groups -= 1
            if groups == 1:
                return
    strength = np.zeros(count)
    for a in range(len(profiles)):
        if kept[piece[a]]:
            strength[_root(group, piece[a])] += profiles[a, LIGHT]
    for p in range(count):
        if strength[_root(group, p)] < smallest * strength.max():
            kept[p] = False


@compiled
def _root(parent: NDArray[np.intp], a: int) -> int:
    """The representative of the group of `a` (union-find); shortens the path to it."""
    while parent[a] != a:
        parent[a] = parent[parent[a]]
        a = parent[a]
    return a


@compiled
def _grid(
    profiles: NDArray[np.float64], piece: NDArray[np.int32], kept: NDArray[np.bool_], side: float
) -> tuple[NDArray[np.intp], NDArray[np.intp], int]:
    """Sort the points of kept pieces into square cells, with a border of empty cells around them.

    Returns
    -------
    order : the numbers of the points, cell by cell.
    start : where each cell begins in `order`.
    across : the number of cells in a row.
    """
    least_i = least_j = math.inf
    most_i = most_j = -math.inf
    for a in range(len(profiles)):
        least_i, most_i = min(least_i, profiles[a, I]), max(most_i, profiles[a, I])
        least_j, most_j = min(least_j, profiles[a, J]), max(most_j, profiles[a, J])
    across = int((most_i - least_i) / side) + 3
    down = int((most_j - least_j) / side) + 3
    start = np.zeros(across * down + 2, np.intp)
    cells = np.empty(len(profiles), np.intp)
    for a in range(len(profiles)):
        cells[a] = (int((profiles[a, J] - least_j) / side) + 1) * across + int((profiles[a, I] - least_i) / side) + 1
        if kept[piece[a]]:
            start[cells[a] + 2] += 1
    for cell in range(start.size - 1):
        start[cell + 1] += start[cell]
    order = np.empty(start[-1], np.intp)
    for a in range(len(profiles)):
        if kept[piece[a]]:
            order[start[cells[a] + 1]] = a
            start[cells[a] + 1] += 1
    return order, start[:-1], across

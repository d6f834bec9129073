"""Which pieces of a frame's points are the stripe: not spots, not ghosts of it, not far and weak reflections."""

import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.profile import CONTRAST, LIGHT, WIDTH
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, SPACING_PX, I, J

BESIDE_PX = 1.5
"""How far from the normal of a point a point of the stripe beside it may lie."""
COPY = 0.5
"""A ghost has less than this part of the stripe's light, as far as that is not saturated."""
APART_PX, APART = 1.0, 0.05
"""Standard deviation of a ghost's distance from the stripe, px and as a part of that distance."""
LENGTH_TO_WIDTH = 2.0
"""A piece that is not longer than this many widths is a spot."""


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
    """Which of (N, 10) profiles, each in one of `count` pieces, belong to the stripe.

    Contrasts in levels of the signal, the rest in px and shares, as `ExtractionParameters` have it.
    """
    length, strong, width = np.zeros(count), np.zeros(count), np.zeros(count)
    for a in range(len(profiles)):
        length[piece[a]] += SPACING_PX
        strong[piece[a]] += SPACING_PX * (profiles[a, CONTRAST] >= smallest_contrast)
        width[piece[a]] += SPACING_PX * profiles[a, WIDTH]
    kept = np.empty(count, np.bool_)
    for p in range(count):
        # Faint ends hang on a piece that is strong somewhere.
        kept[p] = length[p] >= max(shortest, LENGTH_TO_WIDTH * width[p] / length[p]) and strong[p] >= 0.5 * shortest
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
    """Drops pieces most of which runs beside a stronger one: with less than `part` of its light, or parallel to it.

    Both the stripe and its ghost may be saturated, so that their true light is not known; but a ghost is a copy, and
    lies at one distance all along.
    """
    distance, weaker = _beside_stronger(profiles, piece, kept, reach, part)
    for p in range(len(kept)):
        if not kept[p]:
            continue
        own = piece == p
        apart = distance[own & (distance <= reach)]
        parallel = apart.size > 0.5 * points[p] and apart.std() <= APART_PX + APART * apart.mean()
        if parallel or weaker[own].sum() > 0.5 * points[p]:
            kept[p] = False


@compiled
def _beside_stronger(
    profiles: NDArray[np.float64], piece: NDArray[np.int32], kept: NDArray[np.bool_], reach: float, part: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """For each point, how far the nearest one across the stripe is that a ghost would be a copy of; infinite for none.

    And whether there is one of which it has less than `part` of the light.
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
    """Drops pieces that lie far from the stripe and are weak beside it."""
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
    while parent[a] != a:
        parent[a] = parent[parent[a]]
        a = parent[a]
    return a


@compiled
def _grid(
    profiles: NDArray[np.float64], piece: NDArray[np.int32], kept: NDArray[np.bool_], side: float
) -> tuple[NDArray[np.intp], NDArray[np.intp], int]:
    """The points of kept pieces by square cells: their numbers, where each cell begins, and the cells of a row.

    A border of empty cells runs around, so that every point's cell has eight neighbours.
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

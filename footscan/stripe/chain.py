"""Links between the points of a frame: duplicates across the stripe, neighbours along it, chains and pieces.

Points are looked up by square cells: `Cells` holds a linked list of point numbers for each cell.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.profile import CONTRAST, WIDTH
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, SHARPNESS, I, J

NONE = -1
"""Point number that stands for no point."""
CELL_PX = 8
"""Side of the cells: a little more than the default gap, or half a stripe. Chosen for speed."""
SECTION_PX = 0.5
"""Half thickness in px of the cross-section of a point. Chosen by hand."""
SPUR, BESIDE = 0.5, 0.2
"""A spur is a point that noise makes on the shoulder of the stripe: it has less than this part of the stripe's
contrast, and lies more than this part of its width beside it. Chosen by hand."""
BEHIND, AHEAD = range(2)
"""Columns of `neighbours`: the two sides of a point along the stripe, named with respect to the point's normal."""
MOST_ASIDE = 1.5
"""Largest ratio of the distance of a neighbour across the stripe to that along it. Chosen by hand."""
SAME_WAY = 0.5
"""Cosine of the largest angle by which the stripe turns from a point to its neighbour: 60 degrees. Chosen by hand."""


class Cells(NamedTuple):
    """Linked lists of the points in each square cell of a frame."""

    heads: NDArray[np.int32]
    """(cell rows, cell columns): the first point of each cell, or `NONE`."""
    others: NDArray[np.int32]
    """(N,): the next point in the same cell, or `NONE`."""


@compiled
def place(profiles: NDArray[np.float64], rows: int, columns: int) -> Cells:
    """Sort the points (N, ...) of a frame of `rows` x `columns` px into cells."""
    heads = np.full((rows // CELL_PX + 1, columns // CELL_PX + 1), NONE, np.int32)
    others = np.empty(len(profiles), np.int32)
    for a in range(len(profiles)):
        j, i = max(int(profiles[a, J]), 0) // CELL_PX, max(int(profiles[a, I]), 0) // CELL_PX
        others[a] = heads[j, i]
        heads[j, i] = a
    return Cells(heads, others)


@compiled
def _window(i: float, j: float, reach: float, rows: int, columns: int) -> tuple[int, int, int, int]:
    """The cells, of `rows` x `columns`, whose points may be within reach of (i, j): top, bottom, left, right.

    `bottom` and `right` are excluded.
    """
    return (
        max(int(j - reach), 0) // CELL_PX,
        min(max(int(j + reach), 0) // CELL_PX + 1, rows),
        max(int(i - reach), 0) // CELL_PX,
        min(max(int(i + reach), 0) // CELL_PX + 1, columns),
    )


@compiled
def is_sharpest(profiles: NDArray[np.float64], cells: Cells) -> NDArray[np.bool_]:
    """Select the points (N,) that lie neither in the cross-section of a sharper point nor on its shoulder.

    So the stripe is crossed once at each place.
    """
    heads, others = cells
    sharpest = np.ones(len(profiles), np.bool_)
    for b in range(len(profiles)):
        if not sharpest[b]:
            continue
        i, j, sharp = profiles[b, I], profiles[b, J], profiles[b, SHARPNESS]
        width, contrast = profiles[b, WIDTH], profiles[b, CONTRAST]
        normal_i, normal_j = profiles[b, NORMAL_I], profiles[b, NORMAL_J]
        top, bottom, left, right = _window(i, j, width, *heads.shape)
        for row in range(top, bottom):
            for column in range(left, right):
                a = heads[row, column]
                while a != NONE:
                    # Of equally sharp points the first is kept.
                    other = profiles[a, SHARPNESS]
                    if sharp > other or (sharp == other and b < a):
                        d_i, d_j = profiles[a, I] - i, profiles[a, J] - j
                        off = abs(d_i * normal_j - d_j * normal_i)
                        across = abs(d_i * normal_i + d_j * normal_j)
                        spur = (
                            profiles[a, CONTRAST] < SPUR * contrast
                            and across > BESIDE * width
                            and d_i * d_i + d_j * d_j <= width * width
                        )
                        if spur or (off <= SECTION_PX and across <= 0.5 * width):
                            sharpest[a] = False
                    a = others[a]
    return sharpest


@compiled
def neighbours(profiles: NDArray[np.float64], gap: float, cells: Cells) -> NDArray[np.int32]:
    """Find the nearest points on both sides along the stripe, at most `gap` px away.

    Returns
    -------
    (N, 2) int32, point numbers in the columns `BEHIND` and `AHEAD`; `NONE` at the ends of the stripe.

    Examples
    --------
    Three points in a row, with normals along j:

    >>> from footscan.stripe.profile import COLUMNS
    >>> profiles = np.zeros((3, COLUMNS))
    >>> profiles[:, I], profiles[:, J], profiles[:, NORMAL_J] = [4.0, 6.0, 8.0], 5.0, 1.0
    >>> print(neighbours(profiles, 3.0, place(profiles, 16, 16)))
    [[ 1 -1]
     [ 2  0]
     [-1  1]]
    """
    heads, others = cells
    nearest = np.full((len(profiles), 2), NONE, np.int32)
    for a in range(len(profiles)):
        i, j, normal_i, normal_j = profiles[a, I], profiles[a, J], profiles[a, NORMAL_I], profiles[a, NORMAL_J]
        least_behind = least_ahead = gap * gap
        top, bottom, left, right = _window(i, j, gap, *heads.shape)
        for row in range(top, bottom):
            for column in range(left, right):
                b = heads[row, column]
                while b != NONE:
                    d_i, d_j = profiles[b, I] - i, profiles[b, J] - j
                    along = d_j * normal_i - d_i * normal_j
                    across = d_i * normal_i + d_j * normal_j
                    # A point aside counts as farther than one straight ahead.
                    distance = along * along + 2 * across * across
                    if b != a and abs(across) <= MOST_ASIDE * abs(along) and distance < max(least_behind, least_ahead):
                        turn = normal_i * profiles[b, NORMAL_I] + normal_j * profiles[b, NORMAL_J]
                        if abs(turn) < SAME_WAY:
                            pass
                        elif along > 0 and distance < least_ahead:
                            least_ahead = distance
                            nearest[a, AHEAD] = b
                        elif along <= 0 and distance < least_behind:
                            least_behind = distance
                            nearest[a, BEHIND] = b
                    b = others[b]
    return nearest


@compiled
def in_order(profiles: NDArray[np.float64], nearest: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Order the points (N,) along their chains, each from one end to the other.

    Returns
    -------
    order : (N,) int32, the numbers of the points, chain by chain.
    chain : (N,) int32, the number of the chain of each point in `order`.
    """
    chain = np.empty(len(profiles), np.int32)
    order = np.empty(len(profiles), np.int32)
    taken = np.zeros(len(profiles), np.bool_)
    count = chains = 0
    for seed in range(len(profiles)):
        if taken[seed]:
            continue
        # Walk to one end of the chain; a closed chain is cut open at the seed.
        end, side = seed, BEHIND
        for _ in range(len(profiles)):
            b, onward = _step_from(profiles, nearest, end, side)
            if b in (NONE, seed) or taken[b]:
                break
            end, side = b, onward
        # Walk back through it. Where chains branch, the way back may miss the seed, which then starts another chain.
        for start, way in ((end, 1 - side), (seed, AHEAD)):
            a, side = start, way
            while a != NONE and not taken[a]:
                order[count], chain[count] = a, chains
                taken[a] = True
                count += 1
                a, side = _step_from(profiles, nearest, a, side)
            chains += 1
    return order, chain


@compiled
def _step_from(profiles: NDArray[np.float64], nearest: NDArray[np.int32], a: int, side: int) -> tuple[int, int]:
    """The next point along the stripe from point `a` on its `side`, and the side of that point on which to go on."""
    b = nearest[a, side]
    if b == NONE:
        return NONE, side
    same = profiles[a, NORMAL_I] * profiles[b, NORMAL_I] + profiles[a, NORMAL_J] * profiles[b, NORMAL_J] > 0
    return b, side if same else 1 - side


@compiled
def pieces_of(profiles: NDArray[np.float64], gap: float, cells: Cells) -> tuple[NDArray[np.int32], int]:
    """Number the pieces: points linked by steps of at most `gap` px, or half the stripe's width if that is larger.

    Returns
    -------
    piece : (N,) int32, the number of each point's piece, from 0.
    count : the number of pieces.

    Examples
    --------
    >>> from footscan.stripe.profile import COLUMNS
    >>> profiles = np.zeros((3, COLUMNS))
    >>> profiles[:, I], profiles[:, J] = [4.0, 6.0, 14.0], 5.0
    >>> piece, count = pieces_of(profiles, 3.0, place(profiles, 16, 16))
    >>> print(piece, count)
    [0 0 1] 2
    """
    heads, others = cells
    piece = np.full(len(profiles), NONE, np.int32)
    waiting = np.empty(len(profiles), np.int32)
    count = 0
    for seed in range(len(profiles)):
        if piece[seed] != NONE:
            continue
        piece[seed] = count
        waiting[0], length = seed, 1
        while length:
            length -= 1
            a = waiting[length]
            i, j, width = profiles[a, I], profiles[a, J], profiles[a, WIDTH]
            top, bottom, left, right = _window(i, j, max(gap, 0.5 * width), *heads.shape)
            for row in range(top, bottom):
                for column in range(left, right):
                    b = heads[row, column]
                    while b != NONE:
                        if piece[b] == NONE:
                            d_i, d_j = profiles[b, I] - i, profiles[b, J] - j
                            reach = max(gap, 0.5 * min(width, profiles[b, WIDTH]))
                            if d_i * d_i + d_j * d_j <= reach * reach:
                                piece[b] = count
                                waiting[length] = b
                                length += 1
                        b = others[b]
        count += 1
    return piece, count

"""How the points of a frame hang together: which crosses the stripe again, which comes next along it, which piece.

Points are found by square cells: `Cells` holds for each the number of a point in it, and for each point that of the
next in its cell.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.stripe.profile import CONTRAST, WIDTH
from footscan.stripe.ridge import NORMAL_I, NORMAL_J, SHARPNESS, I, J

NONE = -1
CELL_PX = 8
"""Side of the cells: a little more than a gap or half a stripe."""
SECTION_PX = 0.5
"""Half thickness in px of the cross-section of a point."""
SPUR, BESIDE = 0.5, 0.2
"""A spur that noise puts on the shoulder of the stripe has less than this part of its contrast, and lies at least this
part of its width beside it."""
BEHIND, AHEAD = range(2)
"""Columns of what `neighbours` gives: the sides of a point along the stripe, which is which by its own normal."""
MOST_ASIDE = 1.5
"""How much farther aside than on its neighbour may lie."""
SAME_WAY = 0.5
"""Cosine of the largest angle by which the stripe turns from a point to its neighbour."""


class Cells(NamedTuple):
    """Points by square cells of the frame."""

    heads: NDArray[np.int32]
    """(rows, columns) of cells: the number of a point, or `NONE`."""
    others: NDArray[np.int32]
    """(N,): the next point in the same cell, or `NONE`."""


@compiled
def place(profiles: NDArray[np.float64], rows: int, columns: int) -> Cells:
    """(N, ...) points of a frame of so many rows and columns by the cell they lie in."""
    heads = np.full((rows // CELL_PX + 1, columns // CELL_PX + 1), NONE, np.int32)
    others = np.empty(len(profiles), np.int32)
    for a in range(len(profiles)):
        j, i = max(int(profiles[a, J]), 0) // CELL_PX, max(int(profiles[a, I]), 0) // CELL_PX
        others[a] = heads[j, i]
        heads[j, i] = a
    return Cells(heads, others)


@compiled
def _window(i: float, j: float, reach: float, rows: int, columns: int) -> tuple[int, int, int, int]:
    """Of so many rows and columns of cells those, from and before, whose points may be within reach of (i, j)."""
    return (
        max(int(j - reach), 0) // CELL_PX,
        min(max(int(j + reach), 0) // CELL_PX + 1, rows),
        max(int(i - reach), 0) // CELL_PX,
        min(max(int(i + reach), 0) // CELL_PX + 1, columns),
    )


@compiled
def is_sharpest(profiles: NDArray[np.float64], cells: Cells) -> NDArray[np.bool_]:
    """Which points lie neither in the cross-section of a sharper one nor on its shoulder: a stripe is crossed once."""
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
                    # Of equals, the one that was found first.
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
    """(N, 2): the nearest point on either side along the stripe, at most `gap` px away; `NONE` at its ends."""
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
                    # What lies aside is farther than what lies straight on.
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
    """The points (N,) along each chain from one end to the other, and for each (N,) the number of its chain."""
    chain = np.empty(len(profiles), np.int32)
    order = np.empty(len(profiles), np.int32)
    taken = np.zeros(len(profiles), np.bool_)
    count = chains = 0
    for seed in range(len(profiles)):
        if taken[seed]:
            continue
        # To one end of its chain; a closed chain is cut open at the seed.
        end, side = seed, BEHIND
        for _ in range(len(profiles)):
            b, onward = _step_from(profiles, nearest, end, side)
            if b in (NONE, seed) or taken[b]:
                break
            end, side = b, onward
        # And back through it. Where chains branch, the way back may miss the seed, which then begins one of its own.
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
    """The next point along the stripe beyond point `a` on its `side`, and that point's own side to go on by."""
    b = nearest[a, side]
    if b == NONE:
        return NONE, side
    same = profiles[a, NORMAL_I] * profiles[b, NORMAL_I] + profiles[a, NORMAL_J] * profiles[b, NORMAL_J] > 0
    return b, side if same else 1 - side


@compiled
def pieces_of(profiles: NDArray[np.float64], gap: float, cells: Cells) -> tuple[NDArray[np.int32], int]:
    """A number (N,) for each point, the same for points linked by steps of at most `gap` px; how many numbers.

    Of two points of a wide stripe, by steps of at most half its width.
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

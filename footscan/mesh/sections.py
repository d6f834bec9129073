"""Plane sections of a triangle mesh as closed loops."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from footscan.compiled import compiled
from footscan.mesh.buckets import grouped

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SLABS = 128
"""Slabs of a mesh across X, about 2 mm thick in a foot."""
MARGIN_MM = 1e-6
"""Rounding of coordinates."""


class Cuttable(NamedTuple):
    """A mesh with the neighbours of its faces."""

    vertices: Floats
    """(V, 3) mm"""
    faces: Ints
    """(F, 3)"""
    neighbours: Ints
    """(F, 3) face beyond the edge from corner k to the next; -1 where the mesh ends"""
    slabs: "Slabs"


class Slabs(NamedTuple):
    """The faces of a mesh by the least X of their corners: a plane across X need not be held against all."""

    low: Floats
    """(3,) least coordinates of the mesh, mm"""
    high: Floats
    """(3,) greatest coordinates, mm"""
    start: Ints
    """(S + 1,) where the faces of each slab begin in `order`"""
    order: Ints
    """(F,)"""
    widest: float
    """Largest extent of a face in X, mm"""


class Loop(NamedTuple):
    """A closed curve in which a plane cuts a mesh."""

    points: Floats
    """(N, 3) points where the plane cuts edges of the mesh, mm, in order"""
    edges: Ints
    """(N, 2) vertices of these edges"""
    shares: Floats
    """(N,) place of each point on its edge: 0 at the first vertex, 1 at the second"""
    gap: float
    """Length of the widest opening of the mesh that the loop bridges, mm; 0 if the loop is closed"""


def cuttable(vertices: Floats, faces: NDArray[np.integer]) -> Cuttable:
    """Prepare a mesh, (V, 3) mm and (F, 3), for `cut`."""
    corners, places = np.ascontiguousarray(faces, np.int64), np.ascontiguousarray(vertices, np.float64)
    return Cuttable(places, corners, face_neighbours(corners, len(places)), Slabs(*_slabs(places, corners)))


@compiled
def _slabs(vertices: Floats, faces: Ints) -> tuple[Floats, Floats, Ints, Ints, float]:
    """The fields of `Slabs`."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for axis in range(3):
        for vertex in range(len(vertices)):
            low[axis], high[axis] = min(low[axis], vertices[vertex, axis]), max(high[axis], vertices[vertex, axis])
    widest, slab = 0.0, np.empty(len(faces), np.int64)
    for face in range(len(faces)):
        a, b, c = vertices[faces[face, 0], 0], vertices[faces[face, 1], 0], vertices[faces[face, 2], 0]
        slab[face] = _slab_of(min(a, b, c), low[0], high[0])
        widest = max(widest, max(a, b, c) - min(a, b, c))
    start, order = grouped(slab, SLABS)
    return low, high, start, order, widest


@compiled
def _slab_of(x: float, low: float, high: float) -> int:
    return min(max(int((x - low) / max(high - low, 1e-9) * SLABS), 0), SLABS - 1)


@compiled
def face_neighbours(faces: Ints, count: int) -> Ints:
    """Returns (F, 3) the face beyond the edge from each corner to the next; -1 if there is none.

    If more than two faces meet at an edge, the first two are neighbours.

    Parameters
    ----------
    faces : (F, 3)
    count : number of vertices

    Examples
    --------
    >>> face_neighbours(np.array([[0, 1, 2], [0, 2, 3]]), count=4).tolist()
    [[-1, -1, 1], [0, -1, -1]]
    """
    last, before = np.full(count, -1), np.full(faces.size, -1)  # linked lists of edges, by their lower vertex
    neighbours = np.full(faces.shape, -1)
    for face in range(len(faces)):
        for k in range(3):
            a, b = faces[face, k], faces[face, (k + 1) % 3]
            lower, upper = min(a, b), max(a, b)
            edge = last[lower]
            while edge >= 0:
                other, slot = edge // 3, edge % 3
                if upper == faces[other, slot] or upper == faces[other, (slot + 1) % 3]:
                    break
                edge = before[edge]
            if edge < 0:
                before[3 * face + k] = last[lower]
                last[lower] = 3 * face + k
            elif neighbours[edge // 3, edge % 3] < 0:
                neighbours[edge // 3, edge % 3] = face
                neighbours[face, k] = edge // 3
    return neighbours


def cut(mesh: Cuttable, point: Floats, normal: Floats) -> list[Loop]:
    """Cut a mesh by the plane through (3,) `point`, mm, with the unit normal (3,) `normal`.

    Where the mesh is open, the ends of curves are joined by straight lines, the nearest first.

    Examples
    --------
    The section of a tetrahedron of height 2 at half its height:

    >>> corners = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]])
    >>> mesh = cuttable(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    >>> [loop] = cut(mesh, np.array([0.0, 0, 1]), np.array([0.0, 0, 1]))
    >>> sorted(loop.points.tolist()), loop.gap
    ([[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]], 0.0)
    """
    height = mesh.vertices @ normal - point @ normal
    edges, ends, closed = _traced(mesh.faces, mesh.neighbours, mesh.slabs, point, normal, height)
    curves = [edges[start:end] for start, end in pairwise((0, *ends.tolist()))]
    loops = [_loop(mesh.vertices, height, curve, 0.0) for curve, whole in zip(curves, closed, strict=True) if whole]
    open_curves = [curve for curve, whole in zip(curves, closed, strict=True) if not whole]
    return loops + _joined(mesh.vertices, height, open_curves)


def _loop(vertices: Floats, height: Floats, edges: Ints, gap: float) -> Loop:
    return Loop(*_crossings(vertices, height, edges), gap)


@compiled
def _crossings(vertices: Floats, height: Floats, edges: Ints) -> tuple[Floats, Ints, Floats]:
    """Returns (N, 3) the points where (N, 2) edges cross height 0, the edges, and (N,) the shares on the edges."""
    points, shares = np.empty((len(edges), 3)), np.empty(len(edges))
    for k in range(len(edges)):
        first, second = edges[k]
        shares[k] = height[first] / (height[first] - height[second])
        for axis in range(3):
            points[k, axis] = vertices[first, axis] + shares[k] * (vertices[second, axis] - vertices[first, axis])
    return points, edges, shares


def _joined(vertices: Floats, height: Floats, curves: list[Ints]) -> list[Loop]:
    """Join open curves end to end."""
    if not curves:
        return []
    ends = np.concatenate([_loop(vertices, height, curve[[0, -1]], 0.0).points for curve in curves])
    partner, distance = _nearest_pairs(ends)
    loops, unused = [], set(range(len(curves)))
    while unused:
        pieces, widest, end = [], 0.0, 2 * min(unused)  # curve k begins at end 2 k and ends at end 2 k + 1
        while end // 2 in unused:
            unused.remove(end // 2)
            curve = curves[end // 2]
            pieces.append(curve if end % 2 == 0 else curve[::-1])
            other = end ^ 1
            widest = max(widest, float(distance[other]))
            end = int(partner[other])
        loops.append(_loop(vertices, height, np.concatenate(pieces), widest))
    return loops


def _nearest_pairs(points: Floats) -> tuple[Ints, Floats]:
    """Returns for each of (E, 3) `points`, E even, its partner and their distance; nearest pairs are formed first."""
    apart = cdist(points, points)
    np.fill_diagonal(apart, np.inf)
    partner, distance = np.zeros(len(points), np.int64), np.zeros(len(points))
    for _ in range(len(points) // 2):
        first, second = np.unravel_index(np.argmin(apart), apart.shape)
        partner[first], partner[second] = second, first
        distance[first] = distance[second] = apart[first, second]
        apart[[first, second], :] = apart[:, [first, second]] = np.inf
    return partner, distance


@compiled
def _traced(
    faces: Ints, neighbours: Ints, slabs: Slabs, point: Floats, normal: Floats, height: Floats
) -> tuple[Ints, Ints, NDArray[np.bool_]]:
    """Trace the curves between the vertices at a `height` (V,) of 0 and more, and the others from face to face, open
    curves first.

    Returns (N, 2) the vertices of the edges crossed, (C,) the end of each curve among these, (C,) whether it is closed.
    """
    above = height >= 0
    first_slab, last_slab = _crossed_slabs(slabs, point, normal)
    candidates = slabs.order[slabs.start[first_slab] : slabs.start[last_slab + 1]]
    crossing, crossed = np.zeros(len(faces), np.bool_), np.empty(len(candidates), np.int64)
    count = 0
    for face in candidates:
        first = above[faces[face, 0]]
        if first != above[faces[face, 1]] or first != above[faces[face, 2]]:
            crossing[face] = True
            crossed[count] = face
            count += 1
    crossed = np.sort(crossed[:count])
    edges = np.empty((2 * count + 1, 2), np.int64)
    ends, closed = np.empty(count, np.int64), np.empty(count, np.bool_)
    length = curves = 0
    for seek_open in (True, False):
        for k in range(count):
            start = int(crossed[k])
            if not crossing[start]:
                continue
            slot = _crossed(faces, above, start, -1)
            other = _crossed(faces, above, start, slot)
            if seek_open:
                if neighbours[start, slot] >= 0:
                    slot, other = other, slot
                if neighbours[start, slot] >= 0:
                    continue
            face, entry = start, slot
            edges[length, 0], edges[length, 1] = faces[face, entry], faces[face, (entry + 1) % 3]
            length += 1
            while face >= 0 and crossing[face]:
                crossing[face] = False
                leave = _crossed(faces, above, face, entry)
                a, b = faces[face, leave], faces[face, (leave + 1) % 3]
                edges[length, 0], edges[length, 1] = a, b
                length += 1
                face = neighbours[face, leave]
                entry = _edge(faces, face, a, b)
            whole = face == start
            if whole:  # the last edge is the first again
                length -= 1
            ends[curves], closed[curves] = length, whole
            curves += 1
    return edges[:length], ends[:curves], closed[:curves]


@compiled
def _crossed_slabs(slabs: Slabs, point: Floats, normal: Floats) -> tuple[int, int]:
    """The first and the last slab with faces that a plane may cross."""
    if normal[0] == 0.0:
        return 0, SLABS - 1
    least, most = np.inf, -np.inf
    for y in (slabs.low[1], slabs.high[1]):
        for z in (slabs.low[2], slabs.high[2]):
            x = point[0] - ((y - point[1]) * normal[1] + (z - point[2]) * normal[2]) / normal[0]
            least, most = min(least, x), max(most, x)
    margin = slabs.widest + MARGIN_MM
    low, high = slabs.low[0], slabs.high[0]
    # Bounds first: a plane nearly along X has corners far away.
    first, last = max(least - margin, low), min(most + margin, high)
    return _slab_of(first, low, high), _slab_of(last, low, high)


@compiled
def _edge(faces: Ints, face: int, a: int, b: int) -> int:
    """Number of the edge of the face that joins the vertices `a` and `b`; -1 if there is no face."""
    for k in range(3):
        c, d = faces[face, k], faces[face, (k + 1) % 3]
        if face >= 0 and ((c == a and d == b) or (c == b and d == a)):
            return k
    return -1


@compiled
def _crossed(faces: Ints, above: NDArray[np.bool_], face: int, other_than: int) -> int:
    """Number of the first edge of the face that is crossed, other than the edge `other_than`."""
    for k in range(3):
        if k != other_than and above[faces[face, k]] != above[faces[face, (k + 1) % 3]]:
            return k
    return -1

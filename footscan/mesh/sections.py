"""Plane sections of a triangle mesh as closed loops."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from footscan.compiled import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Cuttable(NamedTuple):
    """A mesh that knows which faces lie side by side."""

    vertices: Floats
    """(V, 3) mm"""
    faces: Ints
    """(F, 3)"""
    neighbours: Ints
    """(F, 3) face beyond the edge from corner k to the next; -1 where the mesh ends."""


class Loop(NamedTuple):
    """A closed curve in which a plane cuts a mesh."""

    points: Floats
    """(N, 3) where the plane cuts edges of the mesh, mm, in order."""
    edges: Ints
    """(N, 2) the vertices of these edges."""
    shares: Floats
    """(N,) where on its edge each point is: 0 at the first vertex, 1 at the second."""
    gap: float
    """Length of the widest opening of the mesh that the loop runs straight over, mm; 0 where it is closed."""


def cuttable(vertices: Floats, faces: NDArray[np.integer]) -> Cuttable:
    """The mesh, (V, 3) mm and (F, 3), ready for `cut`."""
    corners = np.ascontiguousarray(faces, np.int64)
    return Cuttable(np.ascontiguousarray(vertices, np.float64), corners, face_neighbours(corners, len(vertices)))


@compiled
def face_neighbours(faces: Ints, count: int) -> Ints:
    """(F, 3) the face beyond the edge from each corner of (F, 3) faces to the next, -1 where there is none; `count`
    is that of the vertices. Of more than two faces at an edge the first two belong together."""
    last, before = np.full(count, -1), np.full(faces.size, -1)  # of the edges known by their lower vertex
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
    """The loops in which the plane through (3,) `point` across the unit vector (3,) `normal` cuts the mesh.

    Where the mesh is open, ends of curves are joined straight, the nearest first.
    """
    height = mesh.vertices @ normal - point @ normal
    edges, ends, closed = _traced(mesh.faces, mesh.neighbours, height >= 0)
    curves = [edges[start:end] for start, end in pairwise((0, *ends.tolist()))]
    loops = [_loop(mesh.vertices, height, curve, 0.0) for curve, whole in zip(curves, closed, strict=True) if whole]
    open_curves = [curve for curve, whole in zip(curves, closed, strict=True) if not whole]
    return loops + _joined(mesh.vertices, height, open_curves)


def _loop(vertices: Floats, height: Floats, edges: Ints, gap: float) -> Loop:
    return Loop(*_crossings(vertices, height, edges), gap)


@compiled
def _crossings(vertices: Floats, height: Floats, edges: Ints) -> tuple[Floats, Ints, Floats]:
    """(N, 3) where (N, 2) edges run through height 0, the edges, and (N,) the shares of them there."""
    points, shares = np.empty((len(edges), 3)), np.empty(len(edges))
    for k in range(len(edges)):
        first, second = edges[k]
        shares[k] = height[first] / (height[first] - height[second])
        for axis in range(3):
            points[k, axis] = vertices[first, axis] + shares[k] * (vertices[second, axis] - vertices[first, axis])
    return points, edges, shares


def _joined(vertices: Floats, height: Floats, curves: list[Ints]) -> list[Loop]:
    """Open curves, joined end to end."""
    if not curves:
        return []
    ends = np.concatenate([_loop(vertices, height, curve[[0, -1]], 0.0).points for curve in curves])
    partner, distance = _nearest_pairs(ends)
    loops, unused = [], set(range(len(curves)))
    while unused:
        pieces, widest, end = [], 0.0, 2 * min(unused)  # an even number is where a curve begins, the next its end
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
    """Of (E, 3) `points`, E even, the partner of each and how far it is; the nearest pair first, then the rest."""
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
def _traced(faces: Ints, neighbours: Ints, above: NDArray[np.bool_]) -> tuple[Ints, Ints, NDArray[np.bool_]]:
    """Follows the curves that part the vertices `above`, (V,), from the others, from face to face: open ones first.

    Returns (N, 2) the vertices of the edges crossed, (C,) where each curve ends in them, (C,) whether it is closed.
    """
    crossing, crossed = np.zeros(len(faces), np.bool_), np.empty(len(faces), np.int64)
    count = 0
    for face in range(len(faces)):
        first = above[faces[face, 0]]
        if first != above[faces[face, 1]] or first != above[faces[face, 2]]:
            crossing[face] = True
            crossed[count] = face
            count += 1
    edges = np.empty((2 * count + 1, 2), np.int64)
    ends, closed = np.empty(count, np.int64), np.empty(count, np.bool_)
    length = curves = 0
    for seek_open in (True, False):
        for start in crossed[:count]:
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
def _edge(faces: Ints, face: int, a: int, b: int) -> int:
    """Which edge of the face joins the vertices `a` and `b`; -1 where there is no face."""
    for k in range(3):
        c, d = faces[face, k], faces[face, (k + 1) % 3]
        if face >= 0 and ((c == a and d == b) or (c == b and d == a)):
            return k
    return -1


@compiled
def _crossed(faces: Ints, above: NDArray[np.bool_], face: int, other_than: int) -> int:
    """The first edge of the face that is crossed, `other_than` one left out."""
    for k in range(3):
        if k != other_than and above[faces[face, k]] != above[faces[face, (k + 1) % 3]]:
            return k
    return -1

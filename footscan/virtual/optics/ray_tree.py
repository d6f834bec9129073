"""The first triangle of a mesh that a ray meets, by a bounding volume hierarchy in double precision.

Films must have the same bytes on every processor. Embree does not give that: it works in single precision with the
widest vector instructions that it finds, and its reciprocals are approximations that differ between makers of
processors. Here each result is made of single additions, multiplications, divisions and comparisons in a fixed
order.

The tree is built top down by the surface area heuristic in bins (I. Wald, "On fast construction of SAH-based bounding
volume hierarchies", 2007, DOI 10.1109/RT.2007.4342588); triangles are met as in T. Moeller and B. Trumbore, "Fast,
minimum storage ray/triangle intersection" (1997, DOI 10.1080/10867651.1997.10487468).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LEAF = 4
"""A node with at most this many triangles is not split. Chosen by hand, for time only."""
_BINS = 16
"""Bins of the surface area heuristic. Chosen by hand, for time only."""
_DEPTH = 64
"""Size of the stack of nodes to visit: a bound of memory."""
_EDGE = 1e-12
"""Slack of a triangle's edges, so that no ray passes between two triangles. Chosen by hand."""
_ENDLESS = 1e300
"""Replaces the reciprocal of 0, whose product with 0 would be NaN."""
CONTACT = 1e-3
"""How far behind its origin, in lengths of its direction, a ray still meets the mesh: a sole that stands on the glass,
where rays begin, is met there, on whichever side of the glass its corners were rounded. Chosen by hand."""


class RayTree(NamedTuple):
    """Triangles in the order of the leaves of their tree."""

    bounds: Floats
    """(K, 6) mm: least X, Y, Z and greatest X, Y, Z of each node."""
    children: Ints
    """(K, 2): the two nodes below; of a leaf its first triangle and -1 - the triangle behind its last."""
    corners: Floats
    """(M, 3, 3) mm: a corner of each triangle, and the two edges that begin there."""
    faces: Ints
    """(M,) the triangle's index in the mesh."""


def ray_tree(vertices: Floats, faces: Ints) -> RayTree:
    """Build the tree of a mesh: `vertices` (N, 3) float64, mm; `faces` (M, 3) int64."""
    corners = vertices[faces]
    least, greatest = corners.min(axis=1), corners.max(axis=1)
    order = np.arange(len(faces))
    bounds, children, count = _build(least, greatest, order)
    first = corners[order, 0]
    edges = [corners[order, 1] - first, corners[order, 2] - first]
    return RayTree(bounds[:count], children[:count], np.stack([first, *edges], axis=1), order)


@compiled
def first_hits(origins: Floats, directions: Floats, tree: RayTree) -> tuple[Ints, Floats, Floats]:
    """Where rays meet the mesh first; of two triangles at the same distance the one with the lower index.

    Parameters
    ----------
    origins, directions : (N, 3) float64, mm; directions of any length but 0.

    Returns
    -------
    (N,) index of the triangle, -1 where there is none; (N,) distance in lengths of the direction; (N, 2) the shares
    of the triangle's second and third corner in the point.
    """
    rays = len(origins)
    met, distance, shares = np.empty(rays, np.int64), np.empty(rays), np.empty((rays, 2))
    waiting, near = np.empty(_DEPTH, np.int64), np.empty(_DEPTH)
    for k in range(rays):
        met[k], distance[k], shares[k, 0], shares[k, 1] = _meet(
            origins[k], directions[k], -CONTACT, np.inf, False, tree, waiting, near
        )
    return met, distance, shares


@compiled
def any_hits(origins: Floats, directions: Floats, reach: float, tree: RayTree) -> NDArray[np.bool_]:
    """Whether rays, (N, 3) each, meet the mesh nearer than `reach` lengths of their direction."""
    blocked = np.empty(len(origins), np.bool_)
    waiting, near = np.empty(_DEPTH, np.int64), np.empty(_DEPTH)
    for k in range(len(origins)):
        blocked[k] = _meet(origins[k], directions[k], 0.0, reach, True, tree, waiting, near)[0] >= 0
    return blocked


@compiled
def _meet(
    origin: Floats,
    direction: Floats,
    start: float,
    reach: float,
    any_will_do: bool,
    tree: RayTree,
    waiting: Ints,
    near: Floats,
) -> tuple[int, float, float, float]:
    """The triangle that a ray meets, the distance, and the shares of two corners; -1 where it meets none."""
    ox, oy, oz = origin[0], origin[1], origin[2]
    dx, dy, dz = direction[0], direction[1], direction[2]
    rx = 1.0 / dx if dx != 0.0 else _ENDLESS
    ry = 1.0 / dy if dy != 0.0 else _ENDLESS
    rz = 1.0 / dz if dz != 0.0 else _ENDLESS
    met, best, best_u, best_v = -1, reach, 0.0, 0.0
    bounds, children = tree.bounds, tree.children
    entry = _entry(bounds[0], ox, oy, oz, rx, ry, rz, start)
    if not entry < best:
        return met, best, best_u, best_v
    waiting[0], near[0], count = 0, entry, 1
    while count:
        count -= 1
        node = waiting[count]
        if near[count] > best:
            continue
        first, second = children[node, 0], children[node, 1]
        if second >= 0:
            entry, other = (
                _entry(bounds[first], ox, oy, oz, rx, ry, rz, start),
                _entry(bounds[second], ox, oy, oz, rx, ry, rz, start),
            )
            if other < entry:
                first, second, entry, other = second, first, other, entry
            if other <= best and other < np.inf:
                waiting[count], near[count] = second, other
                count += 1
            if entry <= best and entry < np.inf:
                waiting[count], near[count] = first, entry
                count += 1
            continue
        for triangle in range(first, -1 - second):
            t, u, v = _distance(tree.corners[triangle], ox, oy, oz, dx, dy, dz)
            if not start <= t <= best:
                continue
            face = tree.faces[triangle]
            if t < best or face < met:
                met, best, best_u, best_v = face, t, u, v
                if any_will_do:
                    return met, best, best_u, best_v
    return met, best, best_u, best_v


@compiled
def _distance(
    corner: Floats, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float
) -> tuple[float, float, float]:
    """Where a ray meets a triangle's plane, and the shares of two corners; infinity where it misses the triangle."""
    ax, ay, az = corner[1, 0], corner[1, 1], corner[1, 2]
    bx, by, bz = corner[2, 0], corner[2, 1], corner[2, 2]
    px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    volume = ax * px + ay * py + az * pz
    if volume == 0.0:
        return np.inf, 0.0, 0.0
    scale = 1.0 / volume
    sx, sy, sz = ox - corner[0, 0], oy - corner[0, 1], oz - corner[0, 2]
    u = (sx * px + sy * py + sz * pz) * scale
    qx, qy, qz = sy * az - sz * ay, sz * ax - sx * az, sx * ay - sy * ax
    v = (dx * qx + dy * qy + dz * qz) * scale
    if u < -_EDGE or v < -_EDGE or u + v > 1.0 + _EDGE:
        return np.inf, u, v
    return (bx * qx + by * qy + bz * qz) * scale, u, v


@compiled
def _entry(bounds: Floats, ox: float, oy: float, oz: float, rx: float, ry: float, rz: float, start: float) -> float:
    """Where a ray enters a box, from `start` on; infinity where it misses the box or has left it before."""
    one, other = (bounds[0] - ox) * rx, (bounds[3] - ox) * rx
    entry, way_out = min(one, other), max(one, other)
    one, other = (bounds[1] - oy) * ry, (bounds[4] - oy) * ry
    entry, way_out = max(entry, min(one, other)), min(way_out, max(one, other))
    one, other = (bounds[2] - oz) * rz, (bounds[5] - oz) * rz
    entry, way_out = max(entry, min(one, other), start), min(way_out, max(one, other))
    # Rounding of either side; without slack a ray along a face of the box could miss it.
    return entry if entry <= way_out + 1e-14 * (abs(way_out) + 1.0) else np.inf


@compiled
def _build(least: Floats, greatest: Floats, order: Ints) -> tuple[Floats, Ints, int]:
    """The nodes' bounds and children, and how many there are; `order` is put into the order of the leaves."""
    total = len(order)
    bounds, children = np.empty((max(2 * total, 1), 6)), np.empty((max(2 * total, 1), 2), np.int64)
    begins, ends, nodes = np.empty(total + 1, np.int64), np.empty(total + 1, np.int64), np.empty(total + 1, np.int64)
    begins[0], ends[0], nodes[0] = 0, total, 0
    count, waiting = 1, 1
    while waiting:
        waiting -= 1
        begin, end, node = begins[waiting], ends[waiting], nodes[waiting]
        for axis in range(3):
            low, high = np.inf, -np.inf
            for k in range(begin, end):
                low = min(low, least[order[k], axis])
                high = max(high, greatest[order[k], axis])
            bounds[node, axis], bounds[node, 3 + axis] = low, high
        middle = _split(least, greatest, order, begin, end) if end - begin > _LEAF else begin
        if middle in (begin, end):
            children[node, 0], children[node, 1] = begin, -1 - end
            continue
        children[node, 0], children[node, 1] = count, count + 1
        begins[waiting], ends[waiting], nodes[waiting] = begin, middle, count
        begins[waiting + 1], ends[waiting + 1], nodes[waiting + 1] = middle, end, count + 1
        waiting += 2
        count += 2
    return bounds, children, count


@compiled
def _split(least: Floats, greatest: Floats, order: Ints, begin: int, end: int) -> int:
    """Where the triangles `begin` to `end` of `order`, put in order, are best cut in two; `begin` where nowhere."""
    best_cost, best_axis, best_low, best_scale, best_bin = np.inf, -1, 0.0, 0.0, 0
    for axis in range(3):
        low, high = np.inf, -np.inf
        for k in range(begin, end):
            centre = least[order[k], axis] + greatest[order[k], axis]
            low, high = min(low, centre), max(high, centre)
        if not high > low:
            continue
        scale = _BINS * (1.0 - 1e-9) / (high - low)
        boxes, held = np.empty((_BINS, 6)), np.zeros(_BINS, np.int64)
        boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
        for k in range(begin, end):
            face = order[k]
            place = int((least[face, axis] + greatest[face, axis] - low) * scale)
            held[place] += 1
            for d in range(3):
                boxes[place, d] = min(boxes[place, d], least[face, d])
                boxes[place, 3 + d] = max(boxes[place, 3 + d], greatest[face, d])
        for cut in range(1, _BINS):
            cost = _cost(boxes[:cut], held[:cut]) + _cost(boxes[cut:], held[cut:])
            if cost < best_cost:
                best_cost, best_axis, best_low, best_scale, best_bin = cost, axis, low, scale, cut
    if best_axis < 0:
        return begin
    middle = begin
    for k in range(begin, end):
        face = order[k]
        if int((least[face, best_axis] + greatest[face, best_axis] - best_low) * best_scale) < best_bin:
            order[k], order[middle] = order[middle], face
            middle += 1
    return middle


@compiled
def _cost(boxes: Floats, held: Ints) -> float:
    """Number of triangles in bins times the surface of the box around them; infinite where there are none."""
    count = held.sum()
    if count == 0:
        return np.inf
    x = boxes[:, 3].max() - boxes[:, 0].min()
    y = boxes[:, 4].max() - boxes[:, 1].min()
    z = boxes[:, 5].max() - boxes[:, 2].min()
    value: float = count * (x * y + y * z + z * x)
    return value

"""Edges of a mesh contracted one after another, the one that moves the surface least first.

M. Garland and P. Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997,
doi:10.1145/258734.258849. No edge is contracted that would change how the surface hangs together (the link condition:
T. Dey, H. Edelsbrunner, S. Guha and D. Nekhayev, "Topology preserving edge contraction", 1999). Libraries as fast as
this do not guarantee that, and they cannot keep chosen vertices in place.
"""

import heapq
import math

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.mesh.topology import directed_edges, edge_counts

TOWARDS_EVEN = 1e-7
"""Weight of a vertex's own place against the planes of its triangles; it decides where the surface is flat. Chosen by
hand."""
RIM_WEIGHT = 10.0
"""Weight of the planes that hold an open edge, against the planes of the triangles; chosen by hand."""
MOST_TURN = 0.2
"""Cosine of the largest angle by which a triangle may turn in one contraction, some 78 degrees; chosen by hand."""
XX, XY, XZ, X, YY, YZ, Y, ZZ, Z, ONE = range(10)
"""Columns of a quadric, the upper half of its symmetric matrix."""

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def collapse_edges(
    vertices: Floats, faces: NDArray[np.integer], values: Floats, fixed: NDArray[np.bool_], triangles: int
) -> tuple[Floats, NDArray[np.int32], Floats, NDArray[np.int64]]:
    """Reduce a mesh to at most `triangles`, or to as few as its shape allows.

    A closed manifold mesh stays one, with as many parts and handles. Vertices without a triangle are dropped.

    Parameters
    ----------
    vertices : (V, 3) float64, mm
    faces : (F, 3)
    values : (V, K) float64, interpolated along the edges
    fixed : (V,) true for vertices that are kept in their place

    Returns
    -------
    vertices, faces, values : arrays of the smaller mesh: (W, 3) mm, (G, 3), (W, K)
    source : (W,) for each vertex that is left, the number of an input vertex near it

    Examples
    --------
    A flat square of four triangles around its centre needs only two:

    >>> vertices = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 0]])
    >>> faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    >>> corners = np.array([True, True, True, True, False])
    >>> kept, triangles, _, source = collapse_edges(vertices, faces, np.zeros((5, 0)), corners, triangles=2)
    >>> len(triangles), source.tolist()
    (2, [0, 1, 2, 3])
    """
    middle = vertices.mean(axis=0) if len(vertices) else np.zeros(3)
    places, corners, values = vertices - middle, faces.astype(np.int64), values.astype(np.float64)
    edges, meeting = edge_counts(faces)
    on_rim = np.zeros(len(vertices), np.bool_)
    on_rim[edges[meeting != 2]] = True
    quadrics, held = _quadrics(places, corners), fixed.copy()
    source = np.arange(len(vertices))
    alive = _collapse(places, corners, values, quadrics, edges, on_rim, held, source, triangles)
    used, renumbered = np.unique(corners[alive], return_inverse=True)
    # A fixed vertex is its own source: adding the middle again would change its last digit.
    kept = np.where(held[used, None], vertices[source[used]], places[used] + middle)
    return kept, renumbered.reshape(-1, 3).astype(np.int32), values[used], source[used]


def _quadrics(vertices: Floats, faces: Integers) -> Floats:
    """Returns (V, 10) quadrics: squared distances to the planes around each vertex, by area, and to its own place."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    units, doubled = _unit(np.cross(b - a, c - a))
    quadrics = _sums(faces, _planes(units, a) * doubled[:, None] / 6, len(vertices))

    area = quadrics[:, [XX, YY, ZZ]].sum(axis=1)
    own = np.zeros((len(vertices), 10))
    own[:, [XX, YY, ZZ]] = 1.0
    own[:, [X, Y, Z]] = -vertices
    own[:, ONE] = np.sum(vertices**2, axis=1)
    quadrics += TOWARDS_EVEN * area[:, None] * own

    edges = directed_edges(faces)
    _, which, meeting = np.unique(np.sort(edges, axis=1) @ [len(vertices), 1], return_inverse=True, return_counts=True)
    rim = meeting[which] == 1
    start, end = vertices[edges[rim]].transpose(1, 0, 2)
    across, length = _unit(np.cross(end - start, np.tile(units, (3, 1))[rim]))
    return quadrics + _sums(edges[rim], RIM_WEIGHT * length[:, None] ** 2 * _planes(across, start), len(vertices))


def _sums(groups: Integers, values: Floats, count: int) -> Floats:
    """Returns (count, 10) sums of (N, 10) `values` over the vertices of their (N, K) `groups`."""
    corners = groups.ravel()
    repeated = np.repeat(values, groups.shape[1], axis=0)
    return np.column_stack([np.bincount(corners, column, count) for column in repeated.T])


def _unit(vectors: Floats) -> tuple[Floats, Floats]:
    """Returns (N, 3) vectors of length 1 (zero vectors stay zero) and (N,) their lengths."""
    length = np.linalg.norm(vectors, axis=1)
    return np.divide(vectors, length[:, None], out=np.zeros_like(vectors), where=length[:, None] > 0), length


def _planes(units: Floats, points: Floats) -> Floats:
    """Returns (N, 10) quadrics of the planes through `points` with unit normals `units`."""
    plane = np.column_stack([units, -np.sum(units * points, axis=1)])
    return np.column_stack([plane[:, i] * plane[:, j] for i in range(4) for j in range(i, 4)])


@compiled
def _collapse(
    vertices: Floats,
    faces: Integers,
    values: Floats,
    quadrics: Floats,
    edges: Integers,
    on_rim: NDArray[np.bool_],
    fixed: NDArray[np.bool_],
    source: Integers,
    triangles: int,
) -> NDArray[np.bool_]:
    """Contract edges in place in all these arrays; returns (F,) which faces are left."""
    count = len(faces)
    alive, gone = np.ones(count, np.bool_), np.zeros(len(vertices), np.bool_)
    first, following = _corner_lists(faces, len(vertices))
    changes = np.zeros(len(vertices), np.int64)
    mark, marks = 0, np.zeros(len(vertices), np.int64)
    around, place = np.empty(count, np.int64), np.empty(3)
    queue = [(_cost(vertices, quadrics, fixed, edge[0], edge[1], place), edge[0], edge[1], 0) for edge in edges]
    heapq.heapify(queue)
    while count > triangles and queue:
        cost, u, v, changes_then = heapq.heappop(queue)
        if cost == math.inf:
            break
        if gone[u] or gone[v] or changes[u] + changes[v] != changes_then:
            continue  # the entry is older than a change of one of the two
        mark += 2
        if not _keeps_topology(faces, alive, first, following, on_rim, marks, mark, u, v):
            continue
        _cost(vertices, quadrics, fixed, u, v, place)
        if _turns(vertices, faces, alive, first, following, u, v, place):
            continue
        if _turns(vertices, faces, alive, first, following, v, u, place):
            continue
        share = _share(vertices[u], vertices[v], place)
        for k in range(values.shape[1]):
            values[u, k] += share * (values[v, k] - values[u, k])
        if share > 0.5:
            source[u] = source[v]
        vertices[u, :] = place
        for k in range(quadrics.shape[1]):
            quadrics[u, k] += quadrics[v, k]
        on_rim[u] |= on_rim[v]
        fixed[u] |= fixed[v]
        gone[v] = True
        changes[u] += changes[v] + 1
        left, dropped = _join(faces, alive, first, following, around, u, v)
        count -= dropped
        mark += 1
        marks[u] = mark
        for f in around[:left]:
            for n in faces[f]:
                if marks[n] != mark:
                    marks[n] = mark
                    a, b = min(u, n), max(u, n)
                    cost = _cost(vertices, quadrics, fixed, a, b, place)
                    heapq.heappush(queue, (cost, a, b, changes[a] + changes[b]))
    return alive


@compiled
def _corner_lists(faces: Integers, count: int) -> tuple[Integers, Integers]:
    """Returns linked lists: the first corner of each vertex, and for each corner the next of its vertex; -1 is the end.

    The number of a corner is three times its face plus 0 to 2.
    """
    first, following = np.full(count, -1), np.empty(faces.size, np.int64)
    for corner in range(faces.size - 1, -1, -1):
        vertex = faces[corner // 3, corner % 3]
        following[corner] = first[vertex]
        first[vertex] = corner
    return first, following


@compiled
def _cost(vertices: Floats, quadrics: Floats, fixed: NDArray[np.bool_], u: int, v: int, place: Floats) -> float:
    """Write to `place` where an edge contracts best; returns the cost in mm^4 (squared distance times area)."""
    if fixed[u] and fixed[v]:
        return math.inf
    p, q = quadrics[u], quadrics[v]
    a, b, c, d, e, f = p[XX] + q[XX], p[XY] + q[XY], p[XZ] + q[XZ], p[YY] + q[YY], p[YZ] + q[YZ], p[ZZ] + q[ZZ]
    g, h, i = p[X] + q[X], p[Y] + q[Y], p[Z] + q[Z]
    # The cofactors of the symmetric matrix; `TOWARDS_EVEN` keeps it regular where the faces have any area.
    aa, ab, ac, bb, bc, cc = d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b
    determinant = a * aa + b * ab + c * ac
    if fixed[u] or fixed[v] or determinant <= 0:
        start, end = (u, u) if fixed[u] else (v, v) if fixed[v] else (u, v)
        for k in range(3):
            place[k] = (vertices[start, k] + vertices[end, k]) / 2
    else:
        place[0] = -(aa * g + ab * h + ac * i) / determinant
        place[1] = -(ab * g + bb * h + bc * i) / determinant
        place[2] = -(ac * g + bc * h + cc * i) / determinant
    x, y, z = place[0], place[1], place[2]
    squares, products = a * x * x + d * y * y + f * z * z, b * x * y + c * x * z + e * y * z
    error = squares + 2 * (products + g * x + h * y + i * z) + p[ONE] + q[ONE]
    return float(max(0.0, error))


@compiled
def _keeps_topology(
    faces: Integers,
    alive: NDArray[np.bool_],
    first: Integers,
    following: Integers,
    on_rim: NDArray[np.bool_],
    marks: Integers,
    mark: int,
    u: int,
    v: int,
) -> bool:
    """True if `u` and `v` share no neighbours but those of their common faces, of which there are 1 or 2.

    Writes `mark` and `mark` + 1 into `marks`.
    """
    of_u, of_v, common_faces, common = 0, 0, 0, 0
    corner = first[u]
    while corner >= 0:
        f = corner // 3
        if alive[f]:
            of_u += 1
            for n in faces[f]:
                common_faces += n == v
                marks[n] = mark
        corner = following[corner]
    marks[u] = marks[v] = mark + 1
    corner = first[v]
    while corner >= 0:
        f = corner // 3
        if alive[f]:
            of_v += 1
            for n in faces[f]:
                if marks[n] == mark:
                    marks[n] = mark + 1
                    common += 1
        corner = following[corner]
    if common != common_faces or not 1 <= common_faces <= 2:
        return False
    if common_faces == 1:
        return of_u > 1 or of_v > 1  # a single triangle stays
    return not (on_rim[u] and on_rim[v]) and not (of_u == 3 and of_v == 3)  # so does a tetrahedron


@compiled
def _turns(
    vertices: Floats,
    faces: Integers,
    alive: NDArray[np.bool_],
    first: Integers,
    following: Integers,
    u: int,
    v: int,
    place: Floats,
) -> bool:
    """True if a face at `u` that is not at `v` would turn too far or lose its area with `u` moved to `place`."""
    corner = first[u]
    while corner >= 0:
        f, k = corner // 3, corner % 3
        corner = following[corner]
        b, c = faces[f, (k + 1) % 3], faces[f, (k + 2) % 3]
        if not alive[f] or v in (b, c):
            continue
        x, y, z = _normal(vertices[u], vertices[b], vertices[c])
        new_x, new_y, new_z = _normal(place, vertices[b], vertices[c])
        size = math.sqrt((x * x + y * y + z * z) * (new_x * new_x + new_y * new_y + new_z * new_z))
        if x * new_x + y * new_y + z * new_z <= MOST_TURN * size and x * x + y * y + z * z > 0:
            return True
    return False


@compiled
def _normal(a: Floats, b: Floats, c: Floats) -> tuple[float, float, float]:
    """Normal of a triangle; its length is twice the area."""
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    u, v, w = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return y * w - z * v, z * u - x * w, x * v - y * u


@compiled
def _share(start: Floats, end: Floats, place: Floats) -> float:
    """Position of a place along an edge, from 0 to 1."""
    along, squared = 0.0, 0.0
    for k in range(3):
        along += (place[k] - start[k]) * (end[k] - start[k])
        squared += (end[k] - start[k]) ** 2
    return min(1.0, max(0.0, along / squared)) if squared > 0 else 0.5


@compiled
def _join(
    faces: Integers, alive: NDArray[np.bool_], first: Integers, following: Integers, around: Integers, u: int, v: int
) -> tuple[int, int]:
    """Replace `v` by `u` and write the faces left around it to `around`; returns how many stay and how many vanish."""
    dropped = 0
    corner = first[v]
    while corner >= 0:
        f = corner // 3
        if alive[f]:
            if u in (faces[f, 0], faces[f, 1], faces[f, 2]):
                alive[f] = False
                dropped += 1
            else:
                faces[f, corner % 3] = u
        corner = following[corner]
    left, last = 0, -1
    for head in (first[u], first[v]):
        corner = head
        while corner >= 0:
            after = following[corner]
            if alive[corner // 3]:
                around[left] = corner // 3
                left += 1
                if last < 0:
                    first[u] = corner
                else:
                    following[last] = corner
                last = corner
            corner = after
    following[last] = -1
    return left, dropped

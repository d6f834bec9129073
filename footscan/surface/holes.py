"""Closing of holes by smooth patches."""

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import distance_matrix

from footscan.mesh.topology import directed_edges
from footscan.surface.patch import fair, patch_over

Vertices = NDArray[np.float64]
Faces = NDArray[np.int32]

MAX_RIM = 4000
"""Bound of memory: slits are sought in rims of up to this many vertices, since the search compares all pairs."""
SLIT_RATIO = 4.0
"""The rim of a slit is at least this many times as long as its mouth is wide (half a circle: 1.6 times). Chosen by
hand."""


def close_holes(
    vertices: Vertices, faces: Faces, max_perimeter: float, max_width: float, spacing: float
) -> tuple[Vertices, Faces]:
    """Close every small hole of a mesh by a patch that continues the surface around it.

    Stripe planes miss up to one step of heel and toes and graze the steep surface there: a flat lid would make a foot
    shorter. The gap behind heel and leg often runs up into the opening at the ankle. Therefore the slits of a hole that
    is too large are closed, too.

    Parameters
    ----------
    vertices : (V, 3) float64, mm
    faces : (F, 3) int32, all with the same sense of rotation
    max_perimeter : mm, of holes that are closed
    max_width : mm, of slits that are closed, at their mouth
    spacing : mm, length of the edges of the patches

    Returns
    -------
    vertices, faces : the input arrays, followed by the vertices and faces of the patches
    """
    first_new = count = len(vertices)
    added, patches, closed = [vertices], [faces], list[int]()
    joined: defaultdict[int, set[int]] = defaultdict(set)
    holes = rims(faces)
    _join(joined, faces[np.isin(faces, [vertex for hole in holes for vertex in hole]).sum(axis=1) >= 2])
    for hole in holes:
        for rim in [hole] if perimeter(vertices[hole]) <= max_perimeter else _slits(vertices, hole, max_width):
            at = {vertex: k for k, vertex in enumerate(rim)}
            pairs = ((at[a], at[b]) for a in rim for b in joined[a] if b in at)
            new, patch = patch_over(vertices[rim], spacing, {(a, b) for a, b in pairs if a < b})
            added.append(new)
            patches.append(np.concatenate([rim, np.arange(count, count + len(new))]).astype(np.int32)[patch])
            closed += rim
            _join(joined, patches[-1])
            count += len(new)
    whole = np.concatenate(patches)
    still_open = [vertex for rim in rims(whole) for vertex in rim]
    inner = np.setdiff1d(np.array(closed, np.intp), still_open)
    return fair(np.concatenate(added), whole, inner, np.arange(first_new, count)), whole


def rims(faces: NDArray[np.integer]) -> list[list[int]]:
    """Find the closed loops of edges that have a face on one side only.

    Each loop runs in the direction of a face that would cover it. Loops that touch at a vertex are separated. Chains of
    edges that do not close are left out.

    Examples
    --------
    >>> rims(np.array([[0, 1, 2], [0, 2, 3]]))
    [[0, 3, 2, 1]]
    """
    edges = directed_edges(faces)
    size = int(faces.max()) + 1 if faces.size else 1
    forward, backward = edges @ [size, 1], edges @ [1, size]
    following: dict[int, list[int]] = {}
    forward.sort()
    has_twin = forward[np.searchsorted(forward[:-1], backward)] == backward  # `np.isin` takes ten times as long
    for start, end in edges[~has_twin][:, ::-1].tolist():
        following.setdefault(start, []).append(end)
    loops = []
    for first in sorted(following):
        path = [first]
        while following.get(path[-1]):
            vertex = following[path[-1]].pop()
            if vertex in path:
                at = path.index(vertex)
                loops.append(path[at:])
                del path[at + 1 :]
            else:
                path.append(vertex)
    return loops


def _join(joined: defaultdict[int, set[int]], faces: Faces) -> None:
    """Add to `joined` which vertices the edges of `faces` join."""
    for a, b in directed_edges(faces).tolist():
        joined[a].add(b)
        joined[b].add(a)


def _slits(vertices: Vertices, hole: list[int], max_width: float) -> list[list[int]]:
    """Find the slits in the rim of a `hole`, whose mouths are at most `max_width` wide.

    Each mouth divides the hole into two parts; the part with the smaller area is the slit.
    """
    slits = []
    while 3 < len(hole) <= MAX_RIM:
        corners = vertices[hole]
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
        around = np.abs(along[:, None] - along)
        around = np.minimum(around, perimeter(corners) - around)
        width = distance_matrix(corners, corners)
        deep = (width <= max_width) & (around >= np.maximum(SLIT_RATIO * width, 2 * max_width))
        worth = np.where(deep, around - SLIT_RATIO * width, 0.0)
        first, last = sorted(int(k) for k in np.unravel_index(np.argmax(worth), worth.shape))
        if not worth[first, last] > 0:
            break
        parts = [hole[first : last + 1], hole[last:] + hole[: first + 1]]
        parts.sort(key=lambda part: _area(vertices[part]))
        slits.append(parts[0])
        hole = parts[1]
    return slits


def perimeter(corners: Vertices) -> float:
    """Length in mm of the closed line through (N, 3) `corners`.

    Examples
    --------
    >>> perimeter(np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0]]))
    12.0
    """
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).sum())


def _area(corners: Vertices) -> float:
    """Area in mm² of a closed polygon; for one that is not flat, the area of its projection along the mean normal."""
    centred = corners - corners.mean(axis=0)
    return float(np.linalg.norm(np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)) / 2)

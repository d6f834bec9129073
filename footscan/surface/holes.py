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
"""Vertices of a rim in which slits are sought; the search compares all pairs."""
SLIT_RATIO = 4.0
"""A slit's rim is at least this many times as long as its mouth is wide; around half a circle it is 1.6 times."""


def close_holes(
    vertices: Vertices, faces: Faces, max_perimeter: float, max_width: float, spacing: float
) -> tuple[Vertices, Faces]:
    """A mesh with every small hole closed by a patch that continues the surface around it.

    Stripe planes miss up to one step of heel and toes, and graze what is steep there: a flat lid would make a foot
    shorter. The gap that is left behind heel and leg often runs up into the opening at the ankle: of a hole that is
    too large the slits are closed.

    Parameters
    ----------
    vertices : (V, 3) mm
    faces : (F, 3), all with the same sense of rotation
    max_perimeter : of holes that are closed, mm
    max_width : of slits that are closed, at their mouth, mm
    spacing : edges of the patches are about so long, mm

    Returns
    -------
    vertices, faces : the given ones first
    """
    given = count = len(vertices)
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
    return fair(np.concatenate(added), whole, inner, np.arange(given, count)), whole


def rims(faces: NDArray[np.integer]) -> list[list[int]]:
    """The closed loops of edges with a face on one side only, each in the direction that a face covering it runs.

    Loops that touch at a vertex are told apart; what does not close is left out.
    """
    edges = directed_edges(faces)
    size = int(faces.max()) + 1 if faces.size else 1
    forward, backward = edges @ [size, 1], edges @ [1, size]
    following: dict[int, list[int]] = {}
    for start, end in edges[~np.isin(backward, forward)][:, ::-1].tolist():
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
    """Notes in `joined` which vertices the edges of `faces` join."""
    for a, b in directed_edges(faces).tolist():
        joined[a].add(b)
        joined[b].add(a)


def _slits(vertices: Vertices, hole: list[int], max_width: float) -> list[list[int]]:
    """Parts of the rim of a `hole` that run in and out again, the corners of their mouth at most `max_width` apart.

    At each mouth the hole falls in two; the part with the smaller area is the slit.
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
    """Length in mm of the closed line through (N, 3) `corners`."""
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).sum())


def _area(corners: Vertices) -> float:
    """Area in mm² of a closed polygon, of its projection along its mean normal where it is not flat."""
    centred = corners - corners.mean(axis=0)
    return float(np.linalg.norm(np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)) / 2)

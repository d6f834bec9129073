"""Soles that were not seen: an opening at the floor, or a flat lid over one. They are closed flat at the floor."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from footscan.mesh.sections import face_neighbours
from footscan.mesh.topology import used_vertices

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]

LOW = 0.2
"""The opening of a sole lies below this share of the length; chosen by hand."""
LEVEL = 0.8
"""The area of a sole's opening faces the floor by more than this cosine; chosen by hand."""
OPEN_SHARE = 0.01
"""A sole is open if its openings have more than this share of the squared length as area; smaller holes stay as they
are. Chosen by hand."""
EXACT, FLAT_SHARE = 0.0004, 0.5
"""A lid is flat to the first share of the length, and the second share of its border is an edge. Chosen by hand."""
LID_FACING, EDGE = 0.9999, 0.94
"""Cosines: a lid faces the floor by more than the first, and the skin at its edge turns by more than 20 degrees. A sole
that is pressed flat on a glass leaves it smoothly. Chosen by hand."""
SKIRT = 1e-4
"""Least height of the skin between rim and closing, as a share of the length: no triangle lacks area."""

DOWN = np.array([0.0, 0.0, -1.0])


class Sole(NamedTuple):
    """A foot with a closed sole."""

    vertices: Floats
    """(V, 3)"""
    faces: Faces
    closing: NDArray[np.bool_]
    """(V,) true for vertices on the floor that close the sole"""
    level: float
    """Z of the floor"""
    uneven: float
    """Standard deviation of the height of the rim"""


def close_sole(vertices: Floats, faces: Faces, length: float, floor: float | None = None) -> Sole | None:
    """Close an open sole, or one that has a flat lid, flat at the floor; None if the sole was seen.

    Parameters
    ----------
    vertices : (V, 3), Z up, floor near Z = 0, any unit
    faces : (F, 3), looking outward
    length : of the foot, in the same unit
    floor : Z of the floor; default: that of the lowest vertex
    """
    lid = flat_lid(vertices, faces, length)
    if lid.any():
        vertices, faces = used_vertices(vertices, faces[~lid])
    openings = [rim for rim in holes(faces, len(vertices)) if _is_sole(vertices, rim, length)]
    area = sum(opening_area(vertices[rim])[2] for rim in openings)
    if area < OPEN_SHARE * length**2:
        return None
    level = min(float(vertices[:, 2].min()), np.inf if floor is None else floor) - SKIRT * length
    uneven = float(np.std(vertices[np.concatenate(openings).ravel(), 2]))
    parts, added = [faces], [vertices]
    count = len(vertices)
    for rim in openings:
        ends, number = np.unique(rim, return_inverse=True)
        first, second = (number.reshape(rim.shape) + count).T
        on_floor = vertices[ends] * [1, 1, 0] + [0, 0, level]
        # The rim runs with the skin on its left, so that the closing runs against it.
        a, b, middle = rim[:, 0], rim[:, 1], np.full(len(rim), count + len(ends))
        parts += [np.column_stack(face) for face in ((b, a, first), (b, first, second), (second, first, middle))]
        added += [on_floor, on_floor.mean(axis=0, keepdims=True)]
        count += len(ends) + 1
    closing = np.arange(count) >= len(vertices)
    return Sole(np.concatenate(added), np.concatenate(parts).astype(np.int32), closing, level, uneven)


def flat_lid(vertices: Floats, faces: Faces, length: float, out: Floats = DOWN) -> NDArray[np.bool_]:
    """Returns (F,) the faces of a flat lid; none without one.

    Parameters
    ----------
    vertices : (V, 3)
    faces : (F, 3), looking outward
    length : of the foot, in the unit of the vertices
    out : (3,) unit vector, to where the lid looks; default: over the sole
    """
    corners = vertices[faces]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(crosses, axis=1)
    normals = crosses / np.maximum(doubled, 1e-300)[:, None]
    near = ((vertices @ out).max() - corners @ out).max(axis=1) < EXACT * length
    lid = near & (normals @ out > LID_FACING)
    if doubled[lid].sum() / 2 < OPEN_SHARE * length**2:
        return np.zeros(len(faces), np.bool_)
    neighbours = face_neighbours(np.ascontiguousarray(faces, np.int64), len(vertices))
    face, slot = np.nonzero(lid[:, None] & (neighbours >= 0) & ~lid[neighbours])
    if not len(face):
        return np.zeros(len(faces), np.bool_)
    lengths = np.linalg.norm(corners[face, slot] - corners[face, (slot + 1) % 3], axis=1)
    sharp = np.einsum("ni,ni->n", normals[face], normals[neighbours[face, slot]]) < EDGE
    return lid if lengths[sharp].sum() > FLAT_SHARE * lengths.sum() else np.zeros(len(faces), np.bool_)


def holes(faces: Faces, count: int) -> list[NDArray[np.int64]]:
    """Returns the rim of each hole: (E, 2) open edges, as they run along their faces."""
    corners = np.ascontiguousarray(faces, np.int64)
    face, slot = np.nonzero(face_neighbours(corners, count) < 0)
    rims = np.stack([corners[face, slot], corners[face, (slot + 1) % 3]], axis=1)
    if not len(rims):
        return []
    graph = coo_array((np.ones(len(rims)), (rims[:, 0], rims[:, 1])), shape=(count, count))
    hole = connected_components(graph, directed=False)[1][rims[:, 0]]
    return [rims[hole == number] for number in np.unique(hole)]


def opening_area(rims: Floats) -> Floats:
    """Returns (3,) the area vector of a hole with edges between `rims` (E, 2, 3); it looks into the body."""
    if not len(rims):
        return np.zeros(3)
    from_middle = rims - rims.mean(axis=(0, 1))
    total: Floats = np.cross(from_middle[:, 0], from_middle[:, 1]).sum(axis=0) / 2
    return total


def _is_sole(vertices: Floats, rim: NDArray[np.int64], length: float) -> bool:
    area = opening_area(vertices[rim])
    low = float(vertices[rim][:, :, 2].mean()) < LOW * length
    return bool(low and area[2] > LEVEL * np.linalg.norm(area) and area[2] > 0)

"""All ways to name four straight pieces of the stripe as edges of the reference object, and the map that each makes."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.reference import Edges
from footscan.compiled import compiled

Floats = NDArray[np.float64]
Names = NDArray[np.intp]

EDGES = 16
"""Names are tried among the longest edges."""
SCALE_MM_PX = (0.02, 2.0)
"""Millimetres to the pixel that a foot scanner's camera can have."""
UNIT_MM = 50.0
"""About the object's extent: it makes normals and offsets alike."""
LEAST_VOLUME = 1e-3
"""Of three lines, as unit vectors: below, they meet in one point, near or at infinity."""
LEAST_DEPTH = 0.05

_TRIPLES = [list(three) for three in combinations(range(4), 3)]


def facing_names(edges: Edges) -> Names:
    """(M, 4) edges that can all face one camera, in every order, one edge for each line on which edges lie."""
    names = _supporting_lines(edges)
    every = np.stack(np.meshgrid(*[names] * 4, indexing="ij"), axis=-1).reshape(-1, 4)
    return np.asarray(every[_on_one_side(edges.normal[every])])


def named_maps(names: Names, pieces: Floats, ends: Floats, frames: Names, shifts: Floats, edges: Edges) -> Floats:
    """The homographies (M, 3, 3), last number 1, that take four pieces to edges, for all names that make a view.

    Parameters
    ----------
    names : (N, 4) edges, as of `facing_names`.
    pieces : (4, 3) their lines n_i i + n_j j = d as (n_i, n_j, d), px.
    ends : (8, 2) their ends, px.
    frames : (4,) the frame of each; within one, no edge is named twice.
    shifts : (4, 2) of the object in that frame, mm.
    """
    for a, b in combinations(range(4), 2):
        if frames[a] == frames[b]:
            names = names[names[:, a] != names[:, b]]
    normals = edges.normal[names]
    offsets = edges.offset[names] + np.sum(normals * shifts, axis=2)
    world = np.concatenate([normals, offsets[:, :, np.newaxis] / UNIT_MM], axis=2)
    world /= np.linalg.norm(world, axis=2, keepdims=True)
    volumes = [np.abs(np.linalg.det(world[:, triple])) for triple in _TRIPLES]
    world = world[np.min(volumes, axis=0) > LEAST_VOLUME]
    if not len(world) or min(abs(float(np.linalg.det(pieces[triple]))) for triple in _TRIPLES) == 0.0:
        return np.empty((0, 3, 3))
    # Lines n . x = d are (n, -d); a homography H takes points one way and lines, by its transpose, the other.
    sign = np.array([1.0, 1.0, -1.0])
    from_world = np.linalg.inv(_basis(world * sign * [1.0, 1.0, UNIT_MM]))
    maps = np.swapaxes(_basis((pieces * sign)[np.newaxis]) @ from_world, 1, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        maps = maps / maps[:, 2:, 2:]
    return np.asarray(maps[_are_views(maps, ends)])


def misfits(maps: Floats, pixels: Floats, shift: Floats, edges: Edges, reach_mm: float) -> Floats:
    """(M,) mean distance, mm, at most `reach_mm` a point, of `pixels` (N, 2) by `maps` (M, 3, 3) from the nearest edge
    of the object, shifted by `shift` (N, 2), mm."""
    found: Floats = _misfits(maps, pixels, shift, edges.start, edges.end, reach_mm)
    return found


def can_be_seen(edges: Edges, seen: NDArray[np.bool_]) -> bool:
    """Whether the edges (E,) that are `seen` can all face one camera."""
    return bool(_on_one_side(edges.normal[np.newaxis, seen])[0])


def is_view(matrix: Floats, pixels: Floats) -> bool:
    """Whether a camera can see the plane so: all of it before the camera, and at a scale that a scanner has."""
    return bool(_are_views(matrix[np.newaxis], pixels)[0])


def _on_one_side(normals: Floats) -> NDArray[np.bool_]:
    """Whether some direction has all of the `normals` (M, n, 2) on its side, (M,)."""
    angles = np.sort(np.arctan2(normals[:, :, 1], normals[:, :, 0]), axis=1)
    gaps = np.diff(np.column_stack([angles, angles[:, 0] + 2 * np.pi]), axis=1)
    return np.asarray(gaps.max(axis=1) > np.pi + 1e-6)


def _supporting_lines(edges: Edges) -> Names:
    """One edge of each line on which edges lie, the longest first."""
    seen: dict[tuple[float, ...], int] = {}
    for k in np.argsort(-edges.length, kind="stable").tolist():
        seen.setdefault((*np.round(edges.normal[k], 6).tolist(), round(float(edges.offset[k]), 6)), k)
    return np.array(list(seen.values())[:EDGES], np.intp)


def _basis(lines: Floats) -> Floats:
    """(M, 3, 3) whose columns are the first three of `lines` (M, 4, 3), scaled so that they add up to the fourth."""
    columns = np.swapaxes(lines[:, :3], 1, 2)
    return np.asarray(columns * np.linalg.solve(columns, lines[:, 3, :, np.newaxis])[:, np.newaxis, :, 0])


def _are_views(maps: Floats, pixels: Floats) -> NDArray[np.bool_]:
    taken = np.einsum("mlk,nk->mnl", maps[:, :, :2], pixels) + maps[:, np.newaxis, :, 2]
    depth = taken[:, :, 2]
    ahead = np.all(depth > LEAST_DEPTH, axis=1) | np.all(depth < -LEAST_DEPTH, axis=1)
    safe = np.where(np.abs(depth) > LEAST_DEPTH, depth, 1.0)
    plane = taken[:, :, :2] / safe[:, :, np.newaxis]
    slopes = maps[:, np.newaxis, :2, :2] - plane[:, :, :, np.newaxis] * maps[:, np.newaxis, 2:, :2]
    slopes = slopes / safe[:, :, np.newaxis, np.newaxis]
    # Singular values s, t of a 2 x 2 matrix: s t is its determinant, s^2 + t^2 the sum of its squares.
    area = np.abs(slopes[..., 0, 0] * slopes[..., 1, 1] - slopes[..., 0, 1] * slopes[..., 1, 0])
    total = np.sum(slopes**2, axis=(2, 3))
    largest = np.sqrt((total + np.sqrt(np.maximum(total**2 - 4.0 * area**2, 0.0))) / 2.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        fitting = (largest < SCALE_MM_PX[1]) & (area / largest > SCALE_MM_PX[0])
    return np.asarray(ahead & np.all(fitting, axis=1) & np.isfinite(maps).all(axis=(1, 2)))


@compiled
def _misfits(maps: Floats, pixels: Floats, shift: Floats, start: Floats, end: Floats, reach: float) -> Floats:
    mean = np.zeros(len(maps))
    for m in range(len(maps)):
        h = maps[m]
        for n in range(len(pixels)):
            i, j = pixels[n]
            depth = h[2, 0] * i + h[2, 1] * j + h[2, 2]
            if abs(depth) < 1e-9:
                depth = 1e-9
            y = (h[0, 0] * i + h[0, 1] * j + h[0, 2]) / depth - shift[n, 0]
            z = (h[1, 0] * i + h[1, 1] * j + h[1, 2]) / depth - shift[n, 1]
            least = reach * reach
            for e in range(len(start)):
                way_y, way_z = end[e, 0] - start[e, 0], end[e, 1] - start[e, 1]
                off_y, off_z = y - start[e, 0], z - start[e, 1]
                along = (off_y * way_y + off_z * way_z) / (way_y * way_y + way_z * way_z)
                along = min(max(along, 0.0), 1.0)
                squared = (off_y - along * way_y) ** 2 + (off_z - along * way_z) ** 2
                least = min(least, squared)
            mean[m] += np.sqrt(least) / len(pixels)
    return mean

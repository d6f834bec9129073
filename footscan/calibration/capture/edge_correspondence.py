"""All assignments of edges of the reference object to four straight pieces of the stripe, and the map of each."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.reference import Edges
from footscan.compiled import compiled

Floats = NDArray[np.float64]
Names = NDArray[np.intp]

EDGES = 16
"""Number of the longest edges that are assigned: a bound of time."""
SCALE_MM_PX = (0.02, 2.0)
"""Range of the scale of a foot scanner's camera, mm a px. Chosen by hand."""
UNIT_MM = 50.0
"""Scale of lengths: about the object's extent, so that normals and offsets have similar size."""
LEAST_VOLUME = 1e-3
"""Determinant of three lines, as unit vectors, up to which they meet in one point, near or at infinity. Chosen by
hand."""
SAME_POINT = 1e-12
"""The same for pieces in the image, px: they meet in one point but for rounding, as those of two equal frames do."""
LEAST_DEPTH = 0.05
"""Depth, relative to that of the pixel (0, 0), from which a point lies in front of the camera. Chosen by hand."""
HORIZON = 1e-9
"""Lower bound of a depth by which is divided."""
DECIMALS = 6
"""Decimals to which normals and offsets of edges on one line are equal: rounding."""

_TRIPLES = [list(triple) for triple in combinations(range(4), 3)]


def facing_names(edges: Edges) -> Names:
    """List all sets of four edges that can face one camera.

    Returns
    -------
    (M, 4) numbers of edges, in every order; of edges on one line only the longest is listed.
    """
    names = _supporting_lines(edges)
    quadruples = np.stack(np.meshgrid(*[names] * 4, indexing="ij"), axis=-1).reshape(-1, 4)
    return np.asarray(quadruples[_on_one_side(edges.normal[quadruples])])


def named_maps(names: Names, pieces: Floats, ends: Floats, frames: Names, shifts: Floats, edges: Edges) -> Floats:
    """Compute the homographies that map four pieces to their edges, for all assignments that are possible views.

    Parameters
    ----------
    names : (N, 4) numbers of the edges, as from `facing_names`.
    pieces : (4, 3) lines of the pieces, n_i i + n_j j = d, as (n_i, n_j, d), px.
    ends : (8, 2) ends of the pieces, px.
    frames : (4,) frame of each piece; within a frame, two pieces have different edges.
    shifts : (4, 2) shift of the object in that frame, mm.

    Returns
    -------
    (M, 3, 3) float64, from px to mm; their last number is 1.
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
    seen = pieces / np.linalg.norm(pieces, axis=1, keepdims=True)
    if not len(world) or min(abs(float(np.linalg.det(seen[triple]))) for triple in _TRIPLES) < SAME_POINT:
        return np.empty((0, 3, 3))
    # A line n . x = d is (n, -d). A homography maps points; its transpose maps lines in the opposite direction.
    sign = np.array([1.0, 1.0, -1.0])
    from_world = np.linalg.inv(_basis(world * sign * [1.0, 1.0, UNIT_MM]))
    maps = np.swapaxes(_basis((pieces * sign)[np.newaxis]) @ from_world, 1, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        maps = maps / maps[:, 2:, 2:]
    return np.asarray(maps[_are_views(maps, ends)])


def misfits(maps: Floats, pixels: Floats, shift: Floats, edges: Edges, reach_mm: float) -> Floats:
    """Compute the mean distances (M,), mm, of mapped points from the nearest edge, each at most `reach_mm`.

    Parameters
    ----------
    maps : (M, 3, 3) from px to mm.
    pixels : (N, 2) px.
    shift : (N, 2) shift of the object in the frame of each point, mm.
    """
    means: Floats = _misfits(maps, pixels, shift, edges.start, edges.end, reach_mm)
    return means


def can_be_seen(edges: Edges, seen: NDArray[np.bool_]) -> bool:
    """True if the edges marked in `seen` (E,) can all face one camera."""
    return bool(_on_one_side(edges.normal[np.newaxis, seen])[0])


def is_view(matrix: Floats, pixels: Floats) -> bool:
    """True if a map (3, 3) is possible: all pixels (N, 2) in front of the camera, at the scale of a scanner."""
    return bool(_are_views(matrix[np.newaxis], pixels)[0])


def _on_one_side(normals: Floats) -> NDArray[np.bool_]:
    """True for the sets of `normals` (M, n, 2) that lie on one side of some direction; (M,)."""
    angles = np.sort(np.arctan2(normals[:, :, 1], normals[:, :, 0]), axis=1)
    gaps = np.diff(np.column_stack([angles, angles[:, 0] + 2 * np.pi]), axis=1)
    return np.asarray(gaps.max(axis=1) > np.pi + 1e-6)


def _supporting_lines(edges: Edges) -> Names:
    """The longest edge on each line, the longest first."""
    by_line: dict[tuple[float, ...], int] = {}
    for k in np.argsort(-edges.length, kind="stable").tolist():
        line = (*np.round(edges.normal[k], DECIMALS).tolist(), round(float(edges.offset[k]), DECIMALS))
        by_line.setdefault(line, k)
    return np.array(list(by_line.values())[:EDGES], np.intp)


def _basis(lines: Floats) -> Floats:
    """(M, 3, 3) whose columns are the first three of `lines` (M, 4, 3), scaled so that they add up to the fourth."""
    columns = np.swapaxes(lines[:, :3], 1, 2)
    return np.asarray(columns * np.linalg.solve(columns, lines[:, 3, :, np.newaxis])[:, np.newaxis, :, 0])


def _are_views(maps: Floats, pixels: Floats) -> NDArray[np.bool_]:
    """True for the maps (M, 3, 3) that are possible, as in `is_view`; (M,)."""
    taken = np.einsum("mlk,nk->mnl", maps[:, :, :2], pixels) + maps[:, np.newaxis, :, 2]
    depth = taken[:, :, 2]
    ahead = np.all(depth > LEAST_DEPTH, axis=1) | np.all(depth < -LEAST_DEPTH, axis=1)
    safe = np.where(np.abs(depth) > LEAST_DEPTH, depth, 1.0)
    plane = taken[:, :, :2] / safe[:, :, np.newaxis]
    slopes = maps[:, np.newaxis, :2, :2] - plane[:, :, :, np.newaxis] * maps[:, np.newaxis, 2:, :2]
    slopes = slopes / safe[:, :, np.newaxis, np.newaxis]
    # For the singular values s, t of a 2 x 2 matrix, s t is its determinant and s^2 + t^2 the sum of its squares.
    area = np.abs(slopes[..., 0, 0] * slopes[..., 1, 1] - slopes[..., 0, 1] * slopes[..., 1, 0])
    total = np.sum(slopes**2, axis=(2, 3))
    largest = np.sqrt((total + np.sqrt(np.maximum(total**2 - 4.0 * area**2, 0.0))) / 2.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        fitting = (largest < SCALE_MM_PX[1]) & (area / largest > SCALE_MM_PX[0])
    return np.asarray(ahead & np.all(fitting, axis=1) & np.isfinite(maps).all(axis=(1, 2)))


@compiled
def _misfits(maps: Floats, pixels: Floats, shift: Floats, start: Floats, end: Floats, reach: float) -> Floats:
    """The result of `misfits`, for edges from `start` to `end` (E, 2)."""
    mean = np.zeros(len(maps))
    for m in range(len(maps)):
        h = maps[m]
        for n in range(len(pixels)):
            i, j = pixels[n]
            depth = h[2, 0] * i + h[2, 1] * j + h[2, 2]
            if abs(depth) < HORIZON:
                depth = HORIZON
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

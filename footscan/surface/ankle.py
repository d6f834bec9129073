"""The opening above the ankle, where no camera saw the end of the leg: the leg is cut flat and closed by a lid."""

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.topology import largest_component, used_vertices
from footscan.surface.holes import rims
from footscan.surface.patch import patch_over

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]

LEAST_AREA_MM2 = 800.0
"""Least area of an opening, seen from above: the ankle of the smallest foot has 1,500 mm². Chosen by hand."""
LEVEL_MM = 1.0
"""Thickness of the slices in which the measured share is counted."""
STILL_SEEN = 0.8
"""The cut lies at the highest slice whose measured share is this part of the share below. Front and back of the leg run
along X and may not be met by stripes at any height; that alone is no end of the leg. Chosen by hand."""
BEST_SEEN = 0.75
"""Quantile of the slices' measured shares that stands for the share below; chosen by hand."""
SNAP_MM = 0.1
"""Vertices nearer than this to the cut are moved onto it, since splitting their edges would leave slivers."""


def opening_height(vertices: Floats, faces: Faces, filled: NDArray[np.bool_]) -> float | None:
    """Find the Z in mm at which to cut the leg; None where the surface was measured at its top.

    An opening is filled, faces up, lies in the upper half and is as large as a leg.

    Parameters
    ----------
    vertices : (V, 3) float64, mm, scanner frame (Z up)
    faces : (F, 3)
    filled : (V,) true for vertices that were not measured
    """
    level = np.floor((vertices[:, 2] - vertices[:, 2].min()) / LEVEL_MM).astype(np.intp)
    seen = np.bincount(level, ~filled) / np.maximum(np.bincount(level), 1)
    upper = seen[len(seen) // 2 :]
    highest = int(np.flatnonzero(upper >= STILL_SEEN * np.quantile(upper, BEST_SEEN)).max()) + len(seen) // 2
    height = float(vertices[:, 2].min() + LEVEL_MM * highest)
    corners = vertices[faces[filled[faces].all(axis=1)]]
    upward = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    above = corners[:, :, 2].max(axis=1) > height
    return height if upward[above].sum() > LEAST_AREA_MM2 else None


def cut_flat(vertices: Floats, faces: Faces, height: float, spacing: float) -> tuple[Floats, Faces, NDArray[np.intp]]:
    """Cut a closed mesh at Z = `height` and close it by a flat lid.

    Parameters
    ----------
    vertices : (V, 3) float64, mm, Z up
    faces : (F, 3) int32
    height, spacing : mm, of the cut and of the edges of the lid

    Returns
    -------
    vertices, faces : those kept in their order, then those on the cut, then those of the lid
    origin : (W,) earlier number of each vertex; -1 for new ones

    Examples
    --------
    A tetrahedron of height 2, cut at half its height: the apex gives way to the three corners of the lid.

    >>> vertices = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]])
    >>> faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32)
    >>> cut_vertices, cut_faces, origin = cut_flat(vertices, faces, height=1.0, spacing=2.0)
    >>> cut_vertices[:, 2].tolist(), len(cut_faces), origin.tolist()
    ([0.0, 0.0, 0.0, 1.0, 1.0, 1.0], 8, [0, 1, 2, -1, -1, -1])
    """
    vertices = vertices.copy()
    near = np.abs(vertices[:, 2] - height) < SNAP_MM
    vertices[near, 2] = height
    above = vertices[:, 2] > height
    count = above[faces].sum(axis=1)
    on_cut = vertices[:, 2] == height
    whole = faces[(count == 0) & ~on_cut[faces].all(axis=1)]
    new_vertices, split = _split(vertices, faces[(count > 0) & (count < 3)], above, on_cut, height)
    left = largest_component(np.concatenate([whole, split]))
    below, open_faces = used_vertices(np.concatenate([vertices, new_vertices]), left)
    used = np.unique(left)
    origin = np.where(used < len(vertices), used, -1)
    lids, patches, total = [below], [open_faces], len(below)
    for rim in rims(open_faces):
        inner, patch = patch_over(below[rim], spacing, set())
        inner[:, 2] = height
        lids.append(inner)
        patches.append(np.concatenate([rim, np.arange(total, total + len(inner))]).astype(np.int32)[patch])
        total += len(inner)
    return np.concatenate(lids), np.concatenate(patches), np.concatenate([origin, np.full(total - len(below), -1)])


def faces_on_cut(vertices: NDArray[np.floating], faces: NDArray[np.integer], cut_mm: float | None) -> NDArray[np.bool_]:
    """Returns (F,) which faces are the lid at Z = `cut_mm`; the lid is no skin, so neither measured nor filled.

    Examples
    --------
    >>> vertices = np.array([[0.0, 0, 5], [1, 0, 5], [0, 1, 5], [0, 0, 4]])
    >>> faces_on_cut(vertices, np.array([[0, 1, 2], [0, 1, 3]]), cut_mm=5.0)
    array([ True, False])
    """
    if cut_mm is None:
        return np.zeros(len(faces), np.bool_)
    return np.asarray((vertices[faces, 2] == cut_mm).all(axis=1))


def _split(
    vertices: Floats, faces: Faces, above: NDArray[np.bool_], on_cut: NDArray[np.bool_], height: float
) -> tuple[Floats, Faces]:
    """Returns the new vertices on the cut, and the parts below it of faces with one or two corners above it."""
    made: dict[tuple[int, int], int] = {}
    new: list[Floats] = []

    def crossing(low: int, high: int) -> int:
        if on_cut[low]:
            return low
        if (low, high) not in made:
            share = (height - vertices[low, 2]) / (vertices[high, 2] - vertices[low, 2])
            made[low, high] = len(vertices) + len(new)
            place = vertices[low] + share * (vertices[high] - vertices[low])
            new.append(np.array([place[0], place[1], height]))
        return made[low, high]

    triangles: list[tuple[int, int, int]] = []
    for corners in faces.tolist():
        first = next(k for k in range(3) if not above[corners[k]] and above[corners[k - 1]])  # the first one below
        a, b, c = corners[first], corners[(first + 1) % 3], corners[(first + 2) % 3]
        side = [crossing(a, b)] if above[b] else [b, crossing(b, c)]
        polygon = [a, *side, crossing(a, c)]
        kept = [corner for k, corner in enumerate(polygon) if corner != polygon[k - 1]]
        triangles += [(kept[0], kept[k], kept[k + 1]) for k in range(1, len(kept) - 1)]
    return np.array(new).reshape(-1, 3), np.array(triangles, np.int32).reshape(-1, 3)

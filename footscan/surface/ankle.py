"""The opening above the ankle, where no camera saw an end of the leg: cut flat and closed by a lid."""

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.topology import largest_component, used_vertices
from footscan.surface.holes import rims
from footscan.surface.patch import patch_over

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]

LEAST_AREA_MM2 = 800.0
"""Of an opening, seen from above: an ankle of the smallest foot has 1,500."""
LEVEL_MM = 1.0
"""Heights are looked at in slices of this."""
STILL_SEEN = 0.8
"""The cut lies where so much of the outline is measured, against what is below. Where the leg's front and back run
along X, no stripe may have met them at any height; that alone is no end."""

SNAP_MM = 0.1
"""Vertices so near to the cut are moved onto it, for splitting their edges would leave slivers."""


def opening_height(vertices: Floats, faces: Faces, filled: NDArray[np.bool_]) -> float | None:
    """Z in mm at which the leg is to be cut; None where the surface was measured at its top.

    An opening is filled, looks up, lies in the upper half and is as large as a leg.
    """
    level = np.floor((vertices[:, 2] - vertices[:, 2].min()) / LEVEL_MM).astype(np.intp)
    seen = np.bincount(level, ~filled) / np.maximum(np.bincount(level), 1)
    upper = seen[len(seen) // 2 :]
    highest = int(np.flatnonzero(upper >= STILL_SEEN * np.quantile(upper, 0.75)).max()) + len(seen) // 2
    height = float(vertices[:, 2].min() + LEVEL_MM * highest)
    corners = vertices[faces[filled[faces].all(axis=1)]]
    upward = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    above = corners[:, :, 2].max(axis=1) > height
    return height if upward[above].sum() > LEAST_AREA_MM2 else None


def cut_flat(vertices: Floats, faces: Faces, height: float, spacing: float) -> tuple[Floats, Faces, NDArray[np.intp]]:
    """A closed mesh without what is above `height`, closed by a flat lid.

    Returns
    -------
    vertices, faces : kept ones in their order, then those on the cut, then those of the lid
    origin : (V,) number that each vertex had; -1 for new ones
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
    """(F,) which faces are the lid at Z = `cut_mm`: no skin, and so neither measured nor filled."""
    if cut_mm is None:
        return np.zeros(len(faces), np.bool_)
    return np.asarray((vertices[faces, 2] == cut_mm).all(axis=1))


def _split(
    vertices: Floats, faces: Faces, above: NDArray[np.bool_], on_cut: NDArray[np.bool_], height: float
) -> tuple[Floats, Faces]:
    """The parts of faces with one or two corners above the cut that are not above it, and the vertices that are new."""
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

"""Volume and skin of a foot below a level."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from footscan.compiled import compiled
from footscan.measure.foot_surface import CLOSED_GAP_MM, FootSurface
from footscan.measure.girths import EXCESS_POWER
from footscan.measure.quantity import NotThere, Quantity, combined
from footscan.measure.sections import Cuttable

Floats = NDArray[np.float64]

EDGE = 3.0
"""Times the usual noise; what seems rougher is an edge."""
MEAN_RADIUS_MM = 60.0
"""Of a foot's skin, twice over its mean curvature: much of it is flat."""


def foot_volume(foot: FootSurface) -> Quantity:
    """Below the height of the junction of foot and leg, mm³.

    The flow of (0, 0, z - level) through the surface: the field's divergence is 1, and nothing flows through the cut.
    """
    junction = foot.place("junction_point").z
    level = junction.value
    _check_closed(foot, level)
    triangles, owners = _below(foot.mesh, level)
    areas = _vector_areas(triangles)
    volume = float(np.sum(areas[:, 2] * (triangles[:, :, 2].mean(axis=1) - level)))
    skin = Quantity(0.0, _thirds(foot, np.linalg.norm(areas, axis=1), owners))  # moved outwards it fills its area
    cut_area = -float(areas[:, 2].sum())
    return combined(volume, (1.0, skin), (cut_area, junction))._replace(note=f"below {level:.1f} mm")


def foot_surface(foot: FootSurface) -> Quantity:
    """Of the skin below the height of the junction of foot and leg, sole included, mm².

    Noise makes it rough, and so larger: it is doubled, by trial, and the growth extrapolated to none, as of girths.
    """
    junction = foot.place("junction_point").z
    level = junction.value
    _check_closed(foot, level)
    area = _area(foot.mesh, level)
    noise = np.sqrt(3.0) * np.minimum(foot.noise, EDGE * np.median(foot.noise))
    waves = (np.random.default_rng(0).normal(size=len(noise)) * noise)[:, None] * foot.normals
    rougher = [_area(foot.mesh._replace(vertices=foot.mesh.vertices + sign * waves), level) for sign in (1, -1)]
    value = area - (sum(rougher) / 2 - area) / (2.0**EXCESS_POWER - 1.0)
    slope = (_area(foot.mesh, level + 1.0) - _area(foot.mesh, level - 1.0)) / 2
    # A skin that moves outwards by d grows by d times the sum of its principal curvatures, in the mean 2 / radius.
    triangles, owners = _below(foot.mesh, level)
    areas = np.linalg.norm(_vector_areas(triangles), axis=1)
    grown = Quantity(0.0, _thirds(foot, areas, owners) * (2.0 / MEAN_RADIUS_MM))
    return combined(value, (1.0, grown), (slope, junction))._replace(note=f"below {level:.1f} mm")


def _area(mesh: Cuttable, level: float) -> float:
    return float(_area_below(mesh.vertices, mesh.faces, level))


@compiled
def _area_below(vertices: Floats, faces: NDArray[np.int64], level: float) -> float:
    """What of a triangle lies below is a share of it: of both edges from the corner that is alone on its side."""
    total = 0.0
    for face in range(len(faces)):
        i, j, k = faces[face]
        below = int(vertices[i, 2] < level) + int(vertices[j, 2] < level) + int(vertices[k, 2] < level)
        if below == 0:
            continue
        a, b, c = vertices[i], vertices[j], vertices[k]
        x = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
        y = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
        z = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        share = 1.0
        if below < 3:
            alone, first, second = a[2], b[2], c[2]
            if (b[2] < level) != (a[2] < level) and (b[2] < level) != (c[2] < level):
                alone, first, second = b[2], a[2], c[2]
            elif (c[2] < level) != (a[2] < level) and (c[2] < level) != (b[2] < level):
                alone, first, second = c[2], a[2], b[2]
            tip = (level - alone) ** 2 / ((first - alone) * (second - alone))
            share = tip if below == 1 else 1.0 - tip
        total += share * np.sqrt(x * x + y * y + z * z) / 2
    return total


def _below(mesh: Cuttable, level: float) -> tuple[Floats, NDArray[np.int64]]:
    """(T, 3, 3) the surface below `level` as triangles, and (T,) the face that each is part of."""
    corners = mesh.vertices[mesh.faces]
    under = corners[:, :, 2] < level
    count = under.sum(axis=1)
    whole = np.flatnonzero(count == 3)
    tip, tip_owner = _rolled(corners, under, 1)
    base, base_owner = _rolled(corners, ~under, 1, of=count == 2)
    tips = np.stack([tip[:, 0], _at(tip[:, 0], tip[:, 1], level), _at(tip[:, 0], tip[:, 2], level)], axis=1)
    first, second = _at(base[:, 0], base[:, 1], level), _at(base[:, 0], base[:, 2], level)
    parts = [
        corners[whole],
        tips,
        np.stack([first, base[:, 1], base[:, 2]], axis=1),
        np.stack([first, base[:, 2], second], axis=1),
    ]
    return np.concatenate(parts), np.concatenate([whole, tip_owner, base_owner, base_owner])


def _rolled(
    corners: Floats, marked: NDArray[np.bool_], count: int, of: NDArray[np.bool_] | None = None
) -> tuple[Floats, NDArray[np.int64]]:
    """Faces with one marked corner, turned so that it comes first, and which they are."""
    faces = np.flatnonzero(marked.sum(axis=1) == count if of is None else of)
    first = np.argmax(marked[faces], axis=1)
    order = (first[:, None] + np.arange(3)) % 3
    return corners[faces[:, None], order], faces


def _at(start: Floats, end: Floats, level: float) -> Floats:
    """(N, 3) where edges from `start` to `end` cross the level."""
    share = (level - start[:, 2]) / (end[:, 2] - start[:, 2])
    crossing: Floats = start + share[:, None] * (end - start)
    return crossing


def _vector_areas(triangles: Floats) -> Floats:
    areas: Floats = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return areas


def _thirds(foot: FootSurface, areas: Floats, owners: NDArray[np.int64]) -> Floats:
    """(V,) a third of the area of each triangle to each corner of its face."""
    total = np.zeros(len(foot.normals))
    for corner in range(3):
        total += np.bincount(foot.mesh.faces[owners, corner], areas / 3, len(total))
    return total


def _check_closed(foot: FootSurface, level: float) -> None:
    """Holes below `level` may be as wide as what is closed in a section."""
    faces, slots = np.nonzero(foot.mesh.neighbours < 0)
    first, second = foot.mesh.faces[faces, slots], foot.mesh.faces[faces, (slots + 1) % 3]
    vertices = foot.mesh.vertices
    low = (vertices[first, 2] < level) | (vertices[second, 2] < level)
    first, second = first[low], second[low]
    if not len(first):
        return
    used, renumbered = np.unique(np.concatenate([first, second]), return_inverse=True)
    ends = renumbered.reshape(2, -1)
    graph = coo_array((np.ones(ends.shape[1]), (ends[0], ends[1])), shape=(len(used), len(used)))
    count, hole = connected_components(graph, directed=False)
    widest = max(float(np.linalg.norm(np.ptp(vertices[used[hole == k]], axis=0))) for k in range(count))
    if widest >= CLOSED_GAP_MM:
        raise NotThere(f"the surface has a hole of {widest:.0f} mm")

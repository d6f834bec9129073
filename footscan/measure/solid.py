"""Volume and skin of a foot below a level."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from footscan.compiled import compiled
from footscan.measure.foot_surface import CLOSED_GAP_MM, FootSurface
from footscan.measure.girths import EXCESS_POWER
from footscan.measure.quantity import NotThere, Quantity, combined
from footscan.mesh.sections import Cuttable

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
    skin, seen, volume = _below(foot.mesh.vertices, foot.mesh.faces, level)
    outwards = Quantity(0.0, _thirds(foot, skin))  # skin that moves outwards fills its area
    found = combined(float(volume.sum()), (1.0, outwards), (-float(seen.sum()), junction))
    return found._replace(note=f"below {level:.1f} mm")


def foot_surface(foot: FootSurface) -> Quantity:
    """Of the skin below the height of the junction of foot and leg, sole included, mm².

    Noise makes it rough, and so larger: it is doubled, by trial, and the growth extrapolated to none, as of girths.
    """
    junction = foot.place("junction_point").z
    level = junction.value
    _check_closed(foot, level)
    skin = _skin(foot.mesh, level)
    area = float(skin.sum())
    noise = np.sqrt(3.0) * np.minimum(foot.noise, EDGE * np.median(foot.noise))
    waves = (np.random.default_rng(0).normal(size=len(noise)) * noise)[:, None] * foot.normals
    rougher = [_skin(foot.mesh._replace(vertices=foot.mesh.vertices + sign * waves), level) for sign in (1, -1)]
    value = area - (float(np.sum(rougher)) / 2 - area) / (2.0**EXCESS_POWER - 1.0)
    slope = float(_skin(foot.mesh, level + 1.0).sum() - _skin(foot.mesh, level - 1.0).sum()) / 2
    # A skin that moves outwards by d grows by d times the sum of its principal curvatures, in the mean 2 / radius.
    grown = Quantity(0.0, _thirds(foot, skin) * (2.0 / MEAN_RADIUS_MM))
    return combined(value, (1.0, grown), (slope, junction))._replace(note=f"below {level:.1f} mm")


def _skin(mesh: Cuttable, level: float) -> Floats:
    return _below(mesh.vertices, mesh.faces, level)[0]


@compiled
def _below(vertices: Floats, faces: NDArray[np.int64], level: float) -> tuple[Floats, Floats, Floats]:
    """(F,) area of each face below the level, mm²; (F,) that as seen from above, negative where the face looks down;
    (F,) by how much it adds to the volume up to the level, mm³.

    What of a triangle lies on one side is a share of it: of both edges from the corner that is alone there.
    """
    skin, seen, volume = np.zeros(len(faces)), np.zeros(len(faces)), np.zeros(len(faces))
    for face in range(len(faces)):
        i, j, k = faces[face]
        below = int(vertices[i, 2] < level) + int(vertices[j, 2] < level) + int(vertices[k, 2] < level)
        if below == 0:
            continue
        a, b, c = vertices[i], vertices[j], vertices[k]
        x = ((b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])) / 2
        y = ((b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])) / 2
        z = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2
        share, height = 1.0, (a[2] + b[2] + c[2]) / 3 - level  # the latter summed up over the share
        if below < 3:
            alone, first, second = a[2] - level, b[2] - level, c[2] - level
            if (first < 0) != (alone < 0) and (first < 0) != (second < 0):
                alone, first = first, alone
            elif (second < 0) != (alone < 0) and (second < 0) != (first < 0):
                alone, second = second, alone
            tip = alone**2 / ((first - alone) * (second - alone))
            share, height = (tip, tip * alone / 3) if below == 1 else (1.0 - tip, height - tip * alone / 3)
        skin[face] = share * np.sqrt(x * x + y * y + z * z)
        seen[face], volume[face] = share * z, height * z
    return skin, seen, volume


def _thirds(foot: FootSurface, areas: Floats) -> Floats:
    """(V,) a third of the area of each face, (F,), to each of its corners."""
    total = np.zeros(len(foot.normals))
    for corner in range(3):
        total += np.bincount(foot.mesh.faces[:, corner], areas / 3, len(total))
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

"""Volume and skin area of a foot below a level."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from footscan.compiled import compiled
from footscan.measure.foot_surface import CLOSED_GAP_MM, FootSurface
from footscan.measure.girths import EXCESS_POWER
from footscan.measure.quantity import NotMeasurable, Quantity, combined
from footscan.mesh.sections import Cuttable

Floats = NDArray[np.float64]

EDGE = 3.0
"""Roughness of more than this multiple of the median is an edge, not noise; chosen by hand."""
MEAN_RADIUS_MM = 60.0
"""Twice the reciprocal of the mean sum of principal curvatures of a foot's skin, much of which is flat. Chosen by
hand."""


def foot_volume(foot: FootSurface) -> Quantity:
    """Volume below the height of the junction of foot and leg, mm³.

    By the divergence theorem, it is the flow of the field (0, 0, z - level) through the surface: the divergence of the
    field is 1, and nothing flows through the cut.
    """
    junction = foot.place("junction_point").z
    level = junction.value
    _check_closed(foot, level)
    skin, seen, volume = _below(foot.mesh.vertices, foot.mesh.faces, level)
    outwards = Quantity(0.0, _thirds(foot, skin))  # skin that moves outwards sweeps its area
    total = combined(float(volume.sum()), (1.0, outwards), (-float(seen.sum()), junction))
    return total._replace(note=f"below {level:.1f} mm")


def foot_surface(foot: FootSurface) -> Quantity:
    """Area of the skin below the height of the junction of foot and leg, sole included, mm².

    Noise makes the skin rough and its area larger. A trial doubles the noise, and the growth of the area is
    extrapolated to no noise, as for girths.
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
    # Skin that moves outwards by d grows by d times the sum of its principal curvatures, on average 2 / radius.
    grown = Quantity(0.0, _thirds(foot, skin) * (2.0 / MEAN_RADIUS_MM))
    return combined(value, (1.0, grown), (slope, junction))._replace(note=f"below {level:.1f} mm")


def _skin(mesh: Cuttable, level: float) -> Floats:
    return _below(mesh.vertices, mesh.faces, level)[0]


@compiled
def _below(vertices: Floats, faces: NDArray[np.int64], level: float) -> tuple[Floats, Floats, Floats]:
    """Returns for each face (F,) its area below the level, that area seen from above, and its part of the volume.

    In mm² and mm³. The area seen from above is negative where the face looks down. The part of a triangle on one side
    of the level is the product of the shares of both edges from the corner that is alone there.
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
        share, height = 1.0, (a[2] + b[2] + c[2]) / 3 - level  # the height is integrated over the share
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
    """Returns (V,) areas of the vertices: each gets a third of the (F,) areas of its faces."""
    total = np.zeros(len(foot.normals))
    for corner in range(3):
        total += np.bincount(foot.mesh.faces[:, corner], areas / 3, len(total))
    return total


def _check_closed(foot: FootSurface, level: float) -> None:
    """Raises `NotMeasurable` if the surface has a hole below `level` as wide as `CLOSED_GAP_MM`."""
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
        raise NotMeasurable(f"the surface has a hole of {widest:.0f} mm")

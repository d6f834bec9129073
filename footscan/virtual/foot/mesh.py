"""A closed triangle mesh of the foot's surface, its vertices on the surface."""

import numpy as np
import numpy.typing as npt
from skimage.measure import marching_cubes

from footscan.virtual.foot.field import Field, Floats, field_grid, first_hits

HALF_SPACE_MM = 85.0
"""Farther from the axis than any point of a foot."""

Faces = npt.NDArray[np.int32]


def mesh_field(field: Field, length_mm: float, top_mm: float, resolution_mm: float) -> tuple[Floats, Faces]:
    """A right foot, cut flat at `top_mm`: vertices (N, 3), mm, and outward faces (M, 3).

    The vertices lie on the zero level to 0.001 times the resolution.
    """
    layers = round(top_mm / resolution_mm)
    step_z = top_mm / (layers + 0.5)  # the floor lies midway between two layers, the cut on the last one
    x: Floats = np.arange(-2.5, length_mm + 2.5 + resolution_mm, resolution_mm)
    y: Floats = np.arange(-HALF_SPACE_MM, HALF_SPACE_MM + resolution_mm, resolution_mm)
    z: Floats = np.linspace(top_mm - (layers + 2) * step_z, top_mm, layers + 3)
    values = field_grid(x, y, z, field)
    # A vertex on a node would make triangles without area, and hide which edge it lies on.
    margin = 0.02 * resolution_mm
    values = np.where(np.abs(values) < margin, np.copysign(margin, values), values)
    places, faces, _, _ = marching_cubes(values, 0.0)
    vertices = _onto_surface(places.astype(np.float64), values > 0, (x, y, z), field)
    # Powers differ in their last digit where a processor cannot multiply and add at once: films must not.
    return _close_cut(vertices.round(6), faces.astype(np.int32), places[:, 2] > len(z) - 1 - 1e-4)


def _onto_surface(
    places: Floats, outside: npt.NDArray[np.bool_], axes: tuple[Floats, Floats, Floats], field: Field
) -> Floats:
    """Vertices in mm: each moves along its edge of the grid to where the field is zero.

    So every triangle stays in its cell and none can cross another. `places` are in nodes. A thousandth of the edge is
    kept to either node; the rare vertex in the middle of a cell stays where marching cubes put it.
    """
    nodes = np.rint(places).astype(np.intp)
    offsets = np.abs(places - nodes)
    rows, along = np.arange(len(places)), np.argmax(offsets, axis=1)
    ends = [nodes.copy(), nodes.copy()]
    ends[0][rows, along] = np.floor(places[rows, along]).astype(np.intp)
    ends[1][rows, along] = ends[0][rows, along] + 1
    first_outside = outside[tuple(ends[0].T)][:, None]
    first, second = (np.column_stack([axis[end[:, k]] for k, axis in enumerate(axes)]) for end in ends)
    start, stop = np.where(first_outside, first, second), np.where(first_outside, second, first)
    lengths = np.linalg.norm(stop - start, axis=1)[:, None]
    directions = (stop - start) / lengths
    distances = first_hits(start, directions, float(lengths.max()), field)[:, None]
    vertices = start + np.clip(distances, 1e-3 * lengths, (1 - 1e-3) * lengths) * directions
    in_cell = np.sort(offsets, axis=1)[:, 1] > 1e-4
    linear = np.column_stack([np.interp(places[:, k], np.arange(len(axis)), axis) for k, axis in enumerate(axes)])
    return np.where(in_cell[:, None], linear, vertices)


def _close_cut(vertices: Floats, faces: Faces, on_cut: npt.NDArray[np.bool_]) -> tuple[Floats, Faces]:
    """A fan over the open edge, whose section is convex."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = edges[on_cut[edges].all(axis=1)]
    alone = {(int(a), int(b)) for a, b in edges}
    border = np.array([(b, a) for a, b in edges if (int(b), int(a)) not in alone], dtype=np.int32)
    centre = vertices[border[:, 0]].mean(axis=0)
    fan = np.column_stack([border, np.full(len(border), len(vertices), dtype=np.int32)])
    return np.vstack([vertices, centre]), np.vstack([faces, fan])

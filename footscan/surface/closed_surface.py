"""The closed surface through a cloud: measured where there are points, filled smoothly where there are none."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.mesh import Mesh, with_normals
from footscan.mesh.topology import directed_edges, vertex_normals
from footscan.surface.ankle import cut_flat, opening_height
from footscan.surface.patch import fair
from footscan.surface.poisson import indicator, level_surface
from footscan.surface.projection import MOST_MISFIT, Projection, project
from footscan.surface.travel_ends import TravelEnd, drawn_to_tips, travel_ends
from schemas.base.errors import Finding
from schemas.parameters.surface import SurfaceParameters

LEAST_GRID_MM = 1.0
"""Bound of memory and time: least spacing of the grid."""
EVENING_ROUNDS = 2
"""Rounds that move each vertex along the surface to the mean of its neighbours, since marching cubes leaves slivers.
Chosen by hand."""
LEAST_SECTORS = 7
"""A measured vertex has points in at least this many of eight directions; chosen by hand."""
CAP_STEPS, AWAY_STEPS = 0.25, 0.5
"""Surface is within the outermost stripe if it lies no farther than the first before the plane of that stripe, and
farther than the second from its points, in steps. Chosen by hand."""
LEAST_POINTS = 50
"""Fewer points are refused; chosen by hand."""
LEAST_MEASURED = 0.5
"""Least share of measured vertices: below it, more of the surface would be guessed than seen."""

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]


@dataclass(frozen=True)
class _Cloud:
    points: Floats
    normals: Floats
    camera: NDArray[np.uint8]
    step_mm: float


def close_surface(
    points: NDArray[np.floating],
    normals: NDArray[np.floating],
    camera: NDArray[np.uint8],
    step_mm: float,
    parameters: SurfaceParameters,
) -> Mesh:
    """Compute a closed mesh through `points`, with each vertex marked as measured or filled.

    The metadata name the standard deviations of the X of both ends, where the tips lie beyond the stripes:
    `tip_doubts_mm`; and, where the leg was cut flat, the Z of the cut: `cut_mm`.

    Parameters
    ----------
    points : (N, 3) mm, scanner frame
    normals : (N, 3) unit vectors, outward
    camera : (N,) uint8, camera of origin
    step_mm : distance from one stripe plane to the next, along X

    Raises
    ------
    Finding
        There are too few points, or no closed surface runs through them.
    """
    usable = np.isfinite(points).all(axis=1) & np.isfinite(normals).all(axis=1)
    if usable.sum() < LEAST_POINTS or step_mm <= 0:
        raise Finding(f"{usable.sum()} points in planes {step_mm:g} mm apart, expected a cloud to mesh")
    xyz, directions = np.asarray(points[usable], np.float64), np.asarray(normals[usable], np.float64)
    grazing, ends = travel_ends(xyz, step_mm)
    xyz, directions = xyz[~grazing], directions[~grazing]
    cloud = _Cloud(xyz, directions, camera[usable][~grazing], step_mm)
    limits = (ends[0].limit, ends[1].limit)
    spacing = max(parameters.grid_steps * step_mm, LEAST_GRID_MM)
    rough, faces = level_surface(indicator(xyz, directions, spacing, parameters.blur_steps * step_mm), limits)
    on_cloud = _project(rough, faces, cloud, parameters, 2)
    for _ in range(EVENING_ROUNDS):
        on_cloud = _project(_evened(on_cloud, faces), faces, cloud, parameters, 1)
    vertices = on_cloud.points
    is_measured = (on_cloud.gap_steps <= parameters.gap_steps) & (on_cloud.sectors >= LEAST_SECTORS)
    is_measured &= ~_in_cap(on_cloud, cloud, ends)
    if is_measured.mean() < LEAST_MEASURED:
        raise Finding(
            f"{len(xyz)} points do not surround a solid: {100 * is_measured.mean():.0f} % of a closed surface would "
            f"be measured, expected {100 * LEAST_MEASURED:.0f} % at least"
        )
    height = opening_height(vertices, faces, ~is_measured)
    is_measured &= on_cloud.misfit_steps <= MOST_MISFIT  # after the leg's end was sought, which is where points end
    origin = np.where(is_measured & (on_cloud.nearest >= 0), cloud.camera[on_cloud.nearest], 0).astype(np.uint8)
    on_lid = np.zeros(len(vertices), np.bool_)
    if height is not None:
        vertices, faces, kept = cut_flat(vertices, faces, height, spacing)
        is_measured = (kept >= 0) & is_measured[kept]
        origin = np.where(kept >= 0, origin[kept], 0).astype(np.uint8)
        on_lid = vertices[:, 2] == height
    free = ~is_measured & ~on_lid
    edges = directed_edges(faces)
    rim = np.setdiff1d(edges[free[edges[:, 0]], 1], np.flatnonzero(free | on_lid))
    vertices = fair(vertices, faces, rim, np.flatnonzero(free))
    doubts = [end.doubt_mm(end.reached_mm(vertices)) for end in ends]
    vertices = drawn_to_tips(vertices, ends)
    metadata = {"tip_doubts_mm": " ".join(map(repr, doubts))} | ({} if height is None else {"cut_mm": repr(height)})
    return with_normals(Mesh(vertices, faces, camera=origin, filled=~is_measured, metadata=metadata))


def _project(points: Floats, faces: Faces, cloud: _Cloud, parameters: SurfaceParameters, rounds: int) -> Projection:
    normals = vertex_normals(points, faces)
    return project(points, normals, cloud.points, cloud.normals, cloud.step_mm, parameters.reach_steps, rounds)


def _in_cap(placed: Projection, cloud: _Cloud, ends: tuple[TravelEnd, TravelEnd]) -> NDArray[np.bool_]:
    """True for the points (N,) within the outermost stripe of an end, as on a heel.

    All their neighbours are of that stripe, which does not say how the surface bends within it.
    """
    away = np.linalg.norm(placed.points - cloud.points[placed.nearest], axis=1)
    outermost = np.maximum(*(end.outward * (placed.points[:, 0] - end.last_mm) for end in ends))
    return np.asarray((outermost > -CAP_STEPS * cloud.step_mm) & (away > AWAY_STEPS * cloud.step_mm))


def _evened(placed: Projection, faces: Faces) -> Floats:
    """Returns (N, 3) the points, each moved within its tangent plane to the mean of its neighbours."""
    edges = directed_edges(faces)
    total = np.zeros_like(placed.points)
    for axis in range(3):
        total[:, axis] = np.bincount(edges[:, 0], placed.points[edges[:, 1], axis], minlength=len(total))
    count = np.bincount(edges[:, 0], minlength=len(total))
    way = total / count[:, None] - placed.points
    way -= np.einsum("ni,ni->n", way, placed.normals)[:, None] * placed.normals
    moved: Floats = placed.points + way
    return moved

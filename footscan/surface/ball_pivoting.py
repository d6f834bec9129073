"""Triangle mesh of a cloud by ball pivoting (Bernardini et al. 1999, doi:10.1109/2945.817351)."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from footscan.mesh.cells import cell_means, group_by_cell
from footscan.mesh.topology import drop_tangles, keep_large_components, used_vertices
from footscan.surface.holes import close_holes
from footscan.surface.projection import project
from schemas.base.errors import Finding
from schemas.parameters.surface import SurfaceParameters

REPAIRS = (0.0, 0.0)
"""Largest slits, in mm, of the repeated closings. A patch may meet the surface beside its hole: tangled faces are
removed, and the holes that they leave are closed again."""
LEAST_MEAN_NORMAL = 0.1
"""Length below which a mean of unit normals has no direction: two sides of a thin part have met. Chosen by hand."""


def mesh_cloud(
    points: NDArray[np.floating], normals: NDArray[np.floating], step_mm: float, parameters: SurfaceParameters
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Mesh a cloud by ball pivoting and close its small holes.

    Parameters
    ----------
    points : (N, 3) mm
    normals : (N, 3) unit vectors, outward
    step_mm : distance from one stripe plane to the next

    Returns
    -------
    vertices : (V, 3) float64, mm, frame of `points`
    faces : (F, 3) int32, counter-clockwise seen from outside

    Raises
    ------
    Finding
        The points are too few or too far apart for a surface.
    """
    from footscan.open3d_without_plots import o3d

    cloud, cloud_normals = np.asarray(points, np.float64), np.asarray(normals, np.float64)
    spacing = parameters.spacing_steps * step_mm
    spaced, spaced_normals = _space_evenly(cloud, cloud_normals, spacing)
    spaced = project(spaced, spaced_normals, cloud, cloud_normals, step_mm, parameters.reach_steps).points
    legacy = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(spaced))
    legacy.normals = o3d.utility.Vector3dVector(spaced_normals)
    radii = o3d.utility.DoubleVector([radius * step_mm for radius in sorted(parameters.ball_radii_steps)])
    pivoted = o3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(legacy, radii)
    faces = keep_large_components(drop_tangles(np.asarray(pivoted.triangles, np.int32)), parameters.component_share)
    if not faces.size:
        raise Finding(f"no surface through {len(points)} points, expected a cloud as dense as {spacing:g} mm")
    vertices, faces = used_vertices(np.asarray(pivoted.vertices), faces)
    for slit in (parameters.slit_mm, *REPAIRS):
        vertices, faces = close_holes(vertices, faces, parameters.hole_mm, slit, spacing)
        faces = drop_tangles(faces)
    return used_vertices(vertices, faces)


def nearest_points(
    vertices: NDArray[np.floating], points: NDArray[np.floating], gap_mm: float
) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Find the nearest point of each vertex, and the vertices that lie farther than `gap_mm` from all points.

    Parameters
    ----------
    vertices : (V, 3) mm
    points : (N, 3) mm, the cloud that was meshed

    Returns
    -------
    filled : (V,) true where no point is within `gap_mm`
    nearest : (V,) int64, number of the point nearest to each vertex

    Examples
    --------
    >>> nearest_points(np.array([[0.0, 0, 0], [9, 0, 0]]), np.array([[1.0, 0, 0], [2, 0, 0]]), gap_mm=3.0)
    (array([False,  True]), array([0, 1]))
    """
    distance, nearest = KDTree(points).query(vertices)
    return np.asarray(distance > gap_mm), np.asarray(nearest, np.int64)


def _space_evenly(
    points: NDArray[np.float64], normals: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns means of points and normals within cubes of `spacing` mm; ball pivoting needs an even spacing."""
    if not len(points):
        raise Finding("no points, expected a cloud to mesh")
    order, starts = group_by_cell(points, np.full(3, spacing))
    both = cell_means(np.hstack([points, normals]), order, starts, np.ones(len(points)))
    length = np.linalg.norm(both[:, 3:], axis=1)
    both = both[length > LEAST_MEAN_NORMAL]
    return both[:, :3], both[:, 3:] / np.linalg.norm(both[:, 3:], axis=1, keepdims=True)

"""The surface of a cloud, by the method that the parameters name."""

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import coordinates, stripe_step
from footscan.mesh.mesh import Mesh
from footscan.mesh.topology import vertex_normals
from footscan.surface.ball_pivoting import mesh_cloud, nearest_points
from footscan.surface.closed_surface import close_surface
from schemas.parameters.surface import SurfaceParameters


def tip_doubts_mm(mesh: Mesh) -> tuple[float, float]:
    """Standard deviations of the X of heel and toes of a surface of `surface_of_cloud`; 0 where stripes show them."""
    heel, toes = mesh.metadata.get("tip_doubts_mm", "0.0 0.0").split()
    return float(heel), float(toes)


def surface_of_cloud(cloud: NDArray[np.void], normals: NDArray[np.float64], parameters: SurfaceParameters) -> Mesh:
    """Mesh a fused cloud, by `close_surface` or by `mesh_cloud`.

    Parameters
    ----------
    cloud : (N,) array of `POINT_DTYPE`, mm, scanner frame
    normals : (N, 3) unit vectors, outward

    Returns
    -------
    Mesh with normals, camera of origin and filled vertices; mm, scanner frame

    Raises
    ------
    Finding
        The points are too few, or form no surface.
    """
    points, step_mm = coordinates(cloud), stripe_step(cloud)
    if parameters.method == "ball_pivoting":
        vertices, faces = mesh_cloud(points, normals, step_mm, parameters)
        filled, nearest = nearest_points(vertices, points, parameters.gap_steps * step_mm)
        camera = np.where(filled, 0, cloud["camera"][nearest]).astype(np.uint8)
        return Mesh(vertices, faces, vertex_normals(vertices, faces), camera=camera, filled=filled)
    return close_surface(points, normals, cloud["camera"], step_mm, parameters)

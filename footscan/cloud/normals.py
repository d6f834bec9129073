"""Normals of a cloud, all pointing outward."""

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import coordinates, stripe_step
from schemas.errors import Finding
from schemas.parameters.normals import NormalParameters

END_WEIGHT = 0.5
"""How much the way from the middle to the ends of the foot counts for what is outside."""


def estimate_normals(cloud: NDArray[np.void], parameters: NormalParameters) -> NDArray[np.float32]:
    """(N, 3) unit normals of `cloud`, from planes through the neighbours of each point.

    They point to where the point's camera stands, for it would not have seen the surface from behind. At heel and toes,
    whose normals lie along X, that says little, and the way from the middle of the cloud decides.

    Parameters
    ----------
    cloud : (N,) array of `POINT_DTYPE`, mm, scanner frame
    """
    import open3d as o3d

    if not len(cloud):
        return np.zeros((0, 3), np.float32)
    if stripe_step(cloud) == 0.0:
        raise Finding(f"{len(cloud)} points in one plane, expected stripes at several places of the travel")
    xyz = coordinates(cloud)
    legacy = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz))
    search = o3d.geometry.KDTreeSearchParamHybrid(parameters.radius_steps * stripe_step(cloud), parameters.neighbours)
    legacy.estimate_normals(search, fast_normal_computation=False)
    normals = np.asarray(legacy.normals)
    backward = np.sum(normals * _outward(cloud, xyz, parameters), axis=1) < 0
    return np.where(backward[:, None], -normals, normals).astype(np.float32)


def _outward(cloud: NDArray[np.void], xyz: NDArray[np.float64], parameters: NormalParameters) -> NDArray[np.float64]:
    """(N, 3) rough directions from the surface to the outside."""
    directions = np.zeros((256, 2))
    for camera, direction in parameters.camera_directions.items():
        directions[camera] = direction
    low, high = np.percentile(xyz[:, 0], [1, 99])
    along = 2 * (xyz[:, 0] - (low + high) / 2) / max(high - low, 1e-6)
    return np.column_stack([END_WEIGHT * np.clip(along, -1, 1) ** 3, directions[cloud["camera"]]])

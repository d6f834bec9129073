"""Points that are not the foot's."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from footscan.cloud.points import coordinates, stripe_step
from schemas.parameters.outliers import OutlierParameters

Removed = dict[int, dict[str, int]]
"""How many points were dropped: camera -> reason -> count."""
BLOCK = 50_000
"""Points whose neighbourhoods are held at once; it bounds the memory."""


def remove_outliers(cloud: NDArray[np.void], parameters: OutlierParameters) -> tuple[NDArray[np.void], Removed]:
    """The points of `cloud` that can be the foot's, in their order, and how many others there were.

    Dropped are, one after the other, points outside the control volume ("volume"), of pixels without support by the
    calibration ("unsupported"), far from their neighbours ("distant"), off the surface through these ("off_surface"),
    and in small islands ("island").

    Parameters
    ----------
    cloud : (N,) array of `POINT_DTYPE`, mm, scanner frame
    """
    tests = {
        "volume": _outside,
        "unsupported": _unsupported,
        "distant": _distant,
        "off_surface": _off_surface,
        "island": _on_island,
    }
    removed: Removed = {int(camera): dict.fromkeys(tests, 0) for camera in np.unique(cloud["camera"])}
    for reason, test in tests.items():
        drop = test(cloud, parameters)
        for camera, count in zip(*np.unique(cloud["camera"][drop], return_counts=True), strict=True):
            removed[int(camera)][reason] = int(count)
        cloud = cloud[~drop]
    return cloud, removed


def _outside(cloud: NDArray[np.void], parameters: OutlierParameters) -> NDArray[np.bool_]:
    inside = np.ones(len(cloud), np.bool_)
    for axis, (low, high) in (("x", parameters.x_mm), ("y", parameters.y_mm), ("z", parameters.z_mm)):
        inside &= (cloud[axis] >= low) & (cloud[axis] <= high)  # false for NaN
    return ~inside


def _unsupported(cloud: NDArray[np.void], parameters: OutlierParameters) -> NDArray[np.bool_]:
    drop: NDArray[np.bool_] = ~cloud["supported"] & parameters.drop_unsupported
    return drop


def _distant(cloud: NDArray[np.void], parameters: OutlierParameters) -> NDArray[np.bool_]:
    """Points whose mean distance to their neighbours is large.

    X is shrunk until stripe planes stand as close as points within them; else all neighbours would be of the same
    plane, and a glint or a ghost is dense within its plane.
    """
    step = stripe_step(cloud)
    if len(cloud) <= parameters.neighbours or step == 0.0:
        return np.zeros(len(cloud), np.bool_)
    xyz = coordinates(cloud) * [parameters.spacing_mm / step, 1.0, 1.0]
    distances, _ = KDTree(xyz).query(xyz, k=parameters.neighbours + 1, workers=-1)
    mean = np.mean(np.atleast_2d(distances)[:, 1:], axis=1)
    far: NDArray[np.bool_] = mean > parameters.distance_ratio * np.median(mean)
    return far


def _off_surface(cloud: NDArray[np.void], parameters: OutlierParameters) -> NDArray[np.bool_]:
    """Points far from the plane through their neighbours, measured by how well these keep to it."""
    off = np.zeros(len(cloud), np.bool_)
    if len(cloud) <= parameters.neighbours:
        return off
    xyz = coordinates(cloud)
    tree = KDTree(xyz)
    for start in range(0, len(xyz), BLOCK):
        block = xyz[start : start + BLOCK]
        _, neighbours = tree.query(block, k=parameters.neighbours + 1, workers=-1)
        around = xyz[np.atleast_2d(neighbours)[:, 1:]]
        middle = around.mean(axis=1)
        around -= middle[:, None]
        variances, directions = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around) / parameters.neighbours)
        distance = np.abs(np.einsum("ni,ni->n", block - middle, directions[:, :, 0]))
        deviation = np.sqrt(np.maximum(variances[:, 0], 0.0))
        limit = np.maximum(parameters.off_surface_mm, parameters.off_surface_ratio * deviation)
        off[start : start + BLOCK] = distance > limit
    return off


def _on_island(cloud: NDArray[np.void], parameters: OutlierParameters) -> NDArray[np.bool_]:
    """Points of small connected parts, found in a grid whose cells join their 26 neighbours."""
    step = stripe_step(cloud)
    if step == 0.0:
        return np.zeros(len(cloud), np.bool_)
    xyz = coordinates(cloud)
    cells = np.floor((xyz - xyz.min(axis=0)) / (parameters.island_gap_steps * step / 1.5)).astype(np.intp)
    occupied = np.zeros(cells.max(axis=0) + 1, np.bool_)
    occupied[tuple(cells.T)] = True
    labels = np.empty(occupied.shape, np.int32)
    ndimage.label(occupied, structure=np.ones((3, 3, 3)), output=labels)
    island = labels[tuple(cells.T)]
    small: NDArray[np.bool_] = np.bincount(island)[island] < parameters.island_share * len(cloud)
    return small

"""The points of all cameras to one cloud."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.cells import cell_means, group_by_cell
from footscan.cloud.points import PLANE_MM, POINT_DTYPE, coordinates
from schemas.parameters.fusion import FusionParameters

UNSUPPORTED_WEIGHT = 1e-9
"""Unsupported points count only in cells that hold no others."""


def fuse(points_by_camera: Iterable[NDArray[np.void]], parameters: FusionParameters) -> NDArray[np.void]:
    """One cloud of the points of several cameras, in an order that does not depend on that of the cameras.

    Where cameras overlap, their points lie on two sheets 0.05 to 0.2 mm apart. Within each stripe plane the points in a
    square cell are averaged, so that one sheet is left; camera, frame and source are those of the point nearest to the
    mean.

    Parameters
    ----------
    points_by_camera : arrays of `POINT_DTYPE`, mm, scanner frame

    Returns
    -------
    (M,) array of `POINT_DTYPE`, ordered by X, then Y, then Z of their cells
    """
    points = np.concatenate([np.empty(0, POINT_DTYPE), *points_by_camera])
    if not points.size:
        return points
    points = points[np.lexsort((points["source"], points["camera"]))]
    xyz = coordinates(points)
    # Reversed, since `group_by_cell` sorts by the last column first.
    cell = np.array([parameters.cell_mm, parameters.cell_mm, PLANE_MM])
    order, starts = group_by_cell(xyz[:, ::-1] + cell / 2, cell)
    means = cell_means(xyz, order, starts, np.where(points["supported"], 1.0, UNSUPPORTED_WEIGHT))

    cell_of = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(order))))
    distance = np.sum((xyz[order] - means[cell_of]) ** 2, axis=1)
    nearest = np.lexsort((distance, cell_of))[starts]
    fused = points[order[nearest]]
    fused["x"], fused["y"], fused["z"] = means.T
    return fused

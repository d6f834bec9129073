"""The body: the planes in which cameras agree on a surface, and the parts of the cloud that belong to it."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from footscan.cloud.cell_cameras import cameras_around
from footscan.cloud.outliers.support import PLANES_MM
from footscan.cloud.points import coordinates, stripe_step
from footscan.mesh.voxels import EMPTY, Voxels, voxelise

CELL_MM = 1.5
"""Side of the cells in Y and Z: two cameras agree where they have points in the same cell, or in cells beside each
other. Chosen by hand."""
FEWEST_CELLS, LEAST_SHARE = 4, 0.1
"""The body is in a plane in which cameras agree in so many cells, and in this share of the cells in which they agree in
its richest planes. Chosen by hand."""
RICH = 0.9
"""Quantile of the planes with agreement that counts as rich. Chosen by hand."""
PART_MM = 2.0
"""Side of the cells in Y and Z by which parts are separate. Chosen by hand."""
AGREED_SHARE = 0.5
"""Cameras agree on a part if they do in this share of its cells. Chosen by hand."""
GAP_PLANES = 3
"""Planes without agreement that do not divide the body. Chosen by hand."""
MARGIN_PLANES, MARGIN_MM = 2, 4.0
"""The body reaches so far beyond the planes in which cameras agree: the first stripes of heel and toes are short, and
heads may be off along the travel. Chosen by hand."""


def body_range(points: NDArray[np.void]) -> tuple[float, float] | None:
    """Find the part of the travel in which the body lies: the longest in which cameras agree on a surface.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, N >= 1, mm, scanner frame, all finite

    Returns
    -------
    Least and greatest X, mm; None if no two cameras agree.
    """
    voxels, agreed = _agreed(points, CELL_MM)
    in_plane = np.bincount(voxels.place[agreed, 0], minlength=voxels.number.shape[0])
    if not in_plane.any():
        return None
    least = max(FEWEST_CELLS, LEAST_SHARE * float(np.quantile(in_plane[in_plane > 0], RICH)))
    planes = np.flatnonzero(in_plane >= least)
    if not len(planes):
        return None
    runs = np.split(planes, np.flatnonzero(np.diff(planes) > GAP_PLANES + 1) + 1)
    run = max(runs, key=lambda run: int(in_plane[run].sum()))
    step = float(voxels.size[0])
    first, last = voxels.origin[0] + step * run[0], voxels.origin[0] + step * (run[-1] + 1)
    margin = MARGIN_PLANES * step + MARGIN_MM
    return float(first - margin), float(last + margin)


def is_apart(points: NDArray[np.void]) -> NDArray[np.bool_]:
    """Select the points of parts that are not joined to the body, and on which cameras do not agree.

    Toes may be apart from the foot; but several cameras see them.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, N >= 1, mm, scanner frame, all finite

    Returns
    -------
    (N,) bool.
    """
    voxels, agreed = _agreed(points, PART_MM)
    labels = np.empty(voxels.number.shape, np.int32)
    ndimage.label(voxels.number != EMPTY, structure=np.ones((3, 3, 3)), output=labels)
    part = labels[tuple(voxels.place.T)]
    cells = np.bincount(part)
    apart = np.bincount(part, agreed) < AGREED_SHARE * cells
    apart[cells.argmax()] = False
    return np.asarray(apart[part][voxels.voxel])


def _agreed(points: NDArray[np.void], cell_mm: float) -> tuple[Voxels, NDArray[np.bool_]]:
    """The cells of points, and for each (V,) whether two cameras have points in it or around it."""
    step = max(stripe_step(points), PLANES_MM)
    voxels = voxelise(coordinates(points), (step, cell_mm, cell_mm))
    numbers = np.unique(points["camera"])
    seen = np.zeros(len(voxels.place), np.uint64)
    np.bitwise_or.at(seen, voxels.voxel, np.uint64(1) << np.searchsorted(numbers, points["camera"]).astype(np.uint64))
    near = cameras_around(voxels.number, seen, voxels.place)
    return voxels, near & (near - np.uint64(1)) != 0

"""What stands in the picture without the foot, or apart from it."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from footscan.cloud.points import PLANE_MM, coordinates, stripe_step
from footscan.compiled import compiled
from footscan.mesh.voxels import EMPTY, MOST_CELLS, voxelise

CELL_MM = 1.0
"""What is static stays within cells of this size and those around them."""
END_FRAMES, END_SHARE = 5, 0.05
"""How many of a camera's frames, or which share of them where that is more, are its first ones, and its last."""
GAP_FRAMES = 4
"""So many frames farther on what is static shows again, or the foot has come to hide it."""
FEWEST = 10
"""So many points in a frame that are not static are the foot's."""
LARGEST_SHARE = 0.5
"""Where more is static, it is what was scanned."""


def is_static(points: NDArray[np.void], share: float) -> NDArray[np.bool_]:
    """Which `points` (N,) of `POINT_DTYPE`, all finite, a camera has at their place from before the foot to beyond it.

    That is a place in Y and Z at which more than `share` of its first frames, and of its last, have a point.
    """
    static = np.zeros(len(points), np.bool_)
    for camera in np.unique(points["camera"]):
        own = np.flatnonzero(points["camera"] == camera)
        own = own[np.argsort(points["frame"][own], kind="stable")]
        static[own] = _static_of_camera(points[own], share)
    return static


def _static_of_camera(points: NDArray[np.void], share: float) -> NDArray[np.bool_]:
    nothing = np.zeros(len(points), np.bool_)
    frame = points["frame"] - points["frame"].min()
    frames = int(frame.max()) + 1
    end = max(END_FRAMES, round(END_SHARE * frames))
    yz = np.column_stack([points["y"], points["z"]]).astype(np.float64)
    if frames < 4 * end or np.prod(np.ptp(yz, axis=0) / CELL_MM + 3) > MOST_CELLS:
        return nothing
    cell = np.floor((yz - yz.min(axis=0)) / CELL_MM).astype(np.int64) + 1
    shape = tuple(cell.max(axis=0) + 2)
    first, last = frame < end, frame >= frames - end
    often = np.minimum(*(_frames_by_cell(cell[part], frame[part], np.zeros(shape, np.int32)) for part in (first, last)))
    static: NDArray[np.bool_] = (often > share * end)[tuple(cell.T)]
    foot = np.flatnonzero(np.bincount(frame[~static], minlength=frames) >= FEWEST)
    if not len(foot) or foot[0] < end or foot[-1] >= frames - end:
        return nothing
    # The foot may hide what is static, and come to stand in its place.
    steady = frame <= _steady_until(cell, frame, np.full(shape, -1, np.int32))[tuple(cell.T)]
    back = (frames - 1 - frame)[::-1]
    steady |= back[::-1] <= _steady_until(cell[::-1].copy(), back, np.full(shape, -1, np.int32))[tuple(cell.T)]
    static &= steady
    return nothing if np.mean(static) > LARGEST_SHARE else static


@compiled
def _frames_by_cell(cell: NDArray[np.int64], frame: NDArray[np.int32], often: NDArray[np.int32]) -> NDArray[np.int32]:
    """In how many frames a cell or one of those around it holds points; `frame` (N,) in order."""
    latest = np.full(often.shape, -1, np.int32)
    for n in range(len(cell)):
        for b in range(cell[n, 0] - 1, cell[n, 0] + 2):
            for c in range(cell[n, 1] - 1, cell[n, 1] + 2):
                if latest[b, c] != frame[n]:
                    latest[b, c] = frame[n]
                    often[b, c] += 1
    return often


@compiled
def _steady_until(cell: NDArray[np.int64], frame: NDArray[np.int32], until: NDArray[np.int32]) -> NDArray[np.int32]:
    """The last frame up to which, from frame 0 on, a cell or one around it holds points; `frame` (N,) in order."""
    for n in range(len(cell)):
        for b in range(cell[n, 0] - 1, cell[n, 0] + 2):
            for c in range(cell[n, 1] - 1, cell[n, 1] + 2):
                if frame[n] - until[b, c] <= GAP_FRAMES:
                    until[b, c] = frame[n]
    return until


def is_island(points: NDArray[np.void], gap_steps: float, least_share: float) -> NDArray[np.bool_]:
    """Which `points` (N,), N >= 1, all finite, are of small parts; these are found in a grid whose cells join their 26
    neighbours, so that parts are apart that are farther than `gap_steps` steps of the travel from each other, about.
    """
    step = stripe_step(points)
    if step == 0.0:
        return np.zeros(len(points), np.bool_)
    voxels = voxelise(coordinates(points), (gap_steps * max(step, PLANE_MM) / 1.5,) * 3)
    labels = np.empty(voxels.number.shape, np.int32)
    ndimage.label(voxels.number != EMPTY, structure=np.ones((3, 3, 3)), output=labels)
    island = labels[tuple(voxels.place.T)][voxels.voxel]
    small: NDArray[np.bool_] = np.bincount(island)[island] < least_share * len(points)
    return small

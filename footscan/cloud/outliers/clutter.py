"""Clutter: static objects, which are seen without the foot too, and small parts apart from the rest."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from footscan.cloud.points import PLANE_MM, coordinates, stripe_step
from footscan.compiled import compiled
from footscan.mesh.voxels import EMPTY, MOST_CELLS, voxelise
from footscan.rows import limits

CELL_MM = 1.0
"""Side of the cells in Y and Z: a static object stays within a cell and those around it. Chosen by hand."""
END_FRAMES, END_SHARE = 5, 0.05
"""A camera's first and last frames: so many, or this share of its frames if that is more. Chosen by hand."""
GAP_FRAMES = 4
"""Frames after which a static object appears again, unless the foot hides it. Chosen by hand."""
FEWEST = 10
"""Points that are not static from which a frame shows the foot. Chosen by hand."""
LARGEST_SHARE = 0.5
"""Share of static points above which they are the scanned object itself, not clutter."""
NEIGHBOUR_STEPS = 1.5
"""Ratio of the gap between parts to the side of the grid cells: points in adjacent cells are about this far apart.
Chosen by hand."""


def is_static(
    points: NDArray[np.void],
    share: float,
    body: tuple[float, float] | None = None,
    filmed: Mapping[int, NDArray[np.float64]] | None = None,
) -> NDArray[np.bool_]:
    """Select static points: the camera sees them in the frames before the foot appears, or after it has gone.

    A static point lies at a place in Y and Z at which more than `share` of the camera's frames before the body, or
    behind it, have a point, and in each frame from there. Without a body a camera's first and last frames are taken
    instead, and both must have it.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, mm, scanner frame, all finite.
    body : least and greatest X of the body, mm; None if unknown.
    filmed : camera -> X of its frames, mm; of a camera that is missing here, frames with points alone are known.

    Returns
    -------
    (N,) bool.

    Examples
    --------
    A lamp in all 40 frames beside a foot in the middle 20:

    >>> from footscan.cloud.points import make_points
    >>> lamp = [(frame, -80.0, 40.0) for frame in range(40)]
    >>> foot = [(frame, float(y), 20.0) for frame in range(10, 30) for y in range(20)]
    >>> frame, y, z = np.array(lamp + foot).T
    >>> points = make_points(np.column_stack([frame, y, z]), 1, frame.astype(int))
    >>> print(np.count_nonzero(is_static(points, 0.8)))
    40
    """
    static = np.zeros(len(points), np.bool_)
    for camera in np.unique(points["camera"]):
        own = np.flatnonzero(points["camera"] == camera)
        own = own[np.argsort(points["frame"][own], kind="stable")]
        static[own] = _static_of_camera(points.take(own), (filmed or {}).get(int(camera)), body, share)
    return static


def _static_of_camera(
    points: NDArray[np.void], x: NDArray[np.float64] | None, body: tuple[float, float] | None, share: float
) -> NDArray[np.bool_]:
    """Select the static points of one camera, ordered by frame; x : (F,) of its frames, or None."""
    nothing = np.zeros(len(points), np.bool_)
    yz = np.column_stack([points["y"], points["z"]]).astype(np.float64)
    low, high = limits(yz)
    if np.prod((high - low) / CELL_MM + 3) > MOST_CELLS:
        return nothing
    cell = np.floor((yz - low) / CELL_MM).astype(np.int64) + 1
    shape = tuple(limits(cell)[1] + 2)
    frame = points["frame"] - points["frame"].min()
    if body is not None:
        if x is None:
            x = np.full(int(frame.max()) + 1, np.nan)
            x[frame] = points["x"]
        else:
            frame = points["frame"]
        return _static_beside(cell, frame, (x < body[0], x > body[1]), shape, share)
    frames = int(frame.max()) + 1
    end = max(END_FRAMES, round(END_SHARE * frames))
    if frames < 4 * end:
        return nothing
    first, last = frame < end, frame >= frames - end
    often = np.minimum(*(_frames_by_cell(cell[part], frame[part], np.zeros(shape, np.int32)) for part in (first, last)))
    static = (often > share * end)[tuple(cell.T)]
    foot = np.flatnonzero(np.bincount(frame[~static], minlength=frames) >= FEWEST)
    if not len(foot) or foot[0] < end or foot[-1] >= frames - end:
        return nothing
    # The foot may hide a static object, and take its place.
    static &= _is_steady(cell, frame, shape) | _is_steady(cell, frames - 1 - frame, shape)
    return nothing if np.mean(static) > LARGEST_SHARE else static


def _static_beside(
    cell: NDArray[np.int64],
    frame: NDArray[np.int32],
    outside: tuple[NDArray[np.bool_], NDArray[np.bool_]],
    shape: tuple[int, ...],
    share: float,
) -> NDArray[np.bool_]:
    """Select the static points of one camera by what it sees before and behind the body.

    frame : (N,) ascending. outside : for each side, (F,) True for the frames there.
    """
    static = np.zeros(len(cell), np.bool_)
    for there in outside:
        count = int(np.count_nonzero(there))
        if count < END_FRAMES:
            continue
        empty = there[frame]
        number = frame if there[: len(there) // 2].sum() > count / 2 else len(there) - 1 - frame
        often = _frames_by_cell(cell[empty], frame[empty], np.zeros(shape, np.int32))
        static |= (often > share * count)[tuple(cell.T)] & (_is_steady(cell, number, shape) | empty)
    return static


def _is_steady(cell: NDArray[np.int64], number: NDArray[np.int32], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Select the points at places that hold points from frame 0 on, in frames that are numbered up, or down."""
    way = 1 if number[0] <= number[-1] else -1
    until = _steady_until(cell[::way].copy(), number[::way].copy(), np.full(shape, -1, np.int32))
    return np.asarray(number <= until[tuple(cell.T)])


@compiled
def _frames_by_cell(cell: NDArray[np.int64], frame: NDArray[np.int32], often: NDArray[np.int32]) -> NDArray[np.int32]:
    """Count into `often` the frames in which a cell or one around it holds points; `frame` (N,) ascending."""
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
    """Find the last frame up to which, from frame 0, a cell or one around it holds points; `frame` (N,) ascending."""
    for n in range(len(cell)):
        for b in range(cell[n, 0] - 1, cell[n, 0] + 2):
            for c in range(cell[n, 1] - 1, cell[n, 1] + 2):
                if frame[n] - until[b, c] <= GAP_FRAMES:
                    until[b, c] = frame[n]
    return until


def is_island(points: NDArray[np.void], gap_steps: float, least_share: float) -> NDArray[np.bool_]:
    """Select the points of small parts of the cloud.

    The cells of a grid are joined with their 26 neighbours, so that parts are separate if they are more than about
    `gap_steps` steps of the travel apart.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, N >= 1, mm, scanner frame, all finite.
    least_share : part of all points below which a part is small.

    Returns
    -------
    (N,) bool.
    """
    step = stripe_step(points)
    if step == 0.0:
        return np.zeros(len(points), np.bool_)
    voxels = voxelise(coordinates(points), (gap_steps * max(step, PLANE_MM) / NEIGHBOUR_STEPS,) * 3)
    labels = np.empty(voxels.number.shape, np.int32)
    ndimage.label(voxels.number != EMPTY, structure=np.ones((3, 3, 3)), output=labels)
    island = labels[tuple(voxels.place.T)][voxels.voxel]
    small: NDArray[np.bool_] = np.bincount(island)[island] < least_share * len(points)
    return small

"""Points of the fused cloud that one camera alone saw, and that do not continue the surface: mirrors, and hairs.

No other camera denies them, for want of a free sight. But the skin goes on from stripe to stripe, and what one camera
sees of it goes on from what several see.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from footscan.cloud.outliers.segments import segments_of
from footscan.cloud.points import coordinates, stripe_step
from footscan.compiled import compiled
from footscan.mesh.buckets import Buckets, sort_into_cubes
from footscan.mesh.voxels import EMPTY, voxelise

REACH_MM = 8.0
"""Distance in Y and Z within which a point's neighbours in the stripes before and behind it are looked for."""
OFF_MM, AT_STEP_MM = 1.0, 3.0
"""A point this far from the middle of these two neighbours is off the surface, where stripes are 3 mm apart; round skin
lies off the middle by the square of their distance. Chosen by hand, as all that follows, on films of five drawn rooms:
of the points farther than 1 mm from the foot a half to nine tenths were dropped, of those nearer than 0.3 mm 0.2 to
0.4 %."""
JOINED_MM = 1.2
"""A point this near to one that several cameras saw, in the same plane, continues it."""
JOINED_OFF = 2.0
"""A piece of stripe that continues what several cameras saw may be so many times as far off: in a cleft between toes
the stripes before and behind lie on other skin. Tuned on four virtual films with 4 mm between stripes
(`regression/suite.yaml`), where 42 to 86 % of the points that were dropped without it were right. 79 to 93 % of these
belong to such pieces, and 30 % of those farther than 1 mm from the foot."""
CELL_MM = 2.0
"""Side of the cells in Y and Z by which parts are separate."""
JOINED_PLANES = 1 / 3
"""A part is skin if it continues what several cameras saw in this share of its planes."""
LARGEST_SHARE = 0.01
"""A part with more of the cloud than this is skin: as much is seen by one camera alone where another one fails."""


def is_off_alone(cloud: NDArray[np.void]) -> NDArray[np.bool_]:
    """Select the points (N,) of a fused cloud that one camera alone saw, and that do not continue the surface.

    Such a point lies off the middle of its neighbours in the stripes before and behind it, or in a part that does not
    join what several cameras saw. A piece of stripe that joins it may lie farther off.

    Examples
    --------
    A stripe of one camera floats 3 mm above the plane that three cameras see:

    >>> from footscan.cloud.points import make_points
    >>> x, y = (part.ravel() for part in np.mgrid[0:30:3, 0:12:0.5])
    >>> alone = (x == 12) & (y > 4) & (y < 8)
    >>> places = np.column_stack([x, y, np.where(alone, 3.0, 0.0)])
    >>> cloud = make_points(places, camera=1, frame=(x / 3).astype(int))
    >>> cloud["cameras"] = np.where(alone, 1, 3)
    >>> print(np.array_equal(is_off_alone(cloud), alone))
    True
    """
    off = np.zeros(len(cloud), np.bool_)
    alone = np.flatnonzero(cloud["cameras"] == 1)
    step = stripe_step(cloud)
    if not len(alone) or len(alone) == len(cloud) or step == 0.0:
        return off
    xyz = coordinates(cloud)
    buckets = sort_into_cubes(xyz, max(REACH_MM, 1.5 * step))
    away, joined = _compare(xyz, alone, cloud["cameras"].copy(), buckets, step)
    piece, _ = segments_of(cloud.take(alone), JOINED_MM, math.inf)
    joins = np.bincount(piece, joined)[piece] > 0
    farthest = OFF_MM * max(step / AT_STEP_MM, 1.0) ** 2 * np.where(joins, JOINED_OFF, 1.0)
    off[alone] = (away > farthest) | _is_apart(xyz[alone], joined, step, LARGEST_SHARE * len(cloud))
    return off


def _is_apart(xyz: NDArray[np.float64], joined: NDArray[np.bool_], step: float, largest: float) -> NDArray[np.bool_]:
    """Select the points (N, 3) of parts that are hardly anywhere joined to what several cameras saw."""
    voxels = voxelise(xyz, (step, CELL_MM, CELL_MM))
    labels = np.empty(voxels.number.shape, np.int32)
    ndimage.label(voxels.number != EMPTY, structure=np.ones((3, 3, 3)), output=labels)
    part = labels[tuple(voxels.place.T)][voxels.voxel].astype(np.int64)
    points = np.bincount(part)
    plane = voxels.place[voxels.voxel, 0].astype(np.int64)
    key = part * voxels.number.shape[0] + plane
    planes, first = np.unique(key, return_index=True)
    joins = np.bincount(np.searchsorted(planes, key), joined) > 0
    share = np.bincount(part[first], joins) / np.maximum(np.bincount(part[first]), 1)
    apart: NDArray[np.bool_] = ((share < JOINED_PLANES) & (points <= largest))[part]
    return apart


@compiled
def _compare(
    xyz: NDArray[np.float64],
    alone: NDArray[np.int64],
    cameras: NDArray[np.uint8],
    buckets: Buckets,
    step: float,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """For each point (M,) of `alone`: distance in mm from the middle of its neighbours before and behind it, 0 if it
    has not both; and whether it is joined to a point that several cameras saw.
    """
    away, joined = np.zeros(len(alone)), np.zeros(len(alone), np.bool_)
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    vector = np.empty((2, 2))
    for n in range(len(alone)):
        place = xyz[alone[n]]
        for axis in range(3):
            cell = math.floor((place[axis] - buckets.low[axis]) / buckets.edge)
            low[axis], high[axis] = max(cell - 1, 0), min(cell + 2, buckets.dims[axis])
        nearest = np.full(2, REACH_MM * REACH_MM)
        for i in range(low[0], high[0]):
            for j in range(low[1], high[1]):
                for k in range(low[2], high[2]):
                    cube = (i * buckets.dims[1] + j) * buckets.dims[2] + k
                    for m in buckets.order[buckets.start[cube] : buckets.start[cube + 1]]:
                        dx, dy, dz = xyz[m, 0] - place[0], xyz[m, 1] - place[1], xyz[m, 2] - place[2]
                        distance = dy * dy + dz * dz
                        if abs(dx) <= 0.5 * step:
                            joined[n] |= cameras[m] > 1 and distance < JOINED_MM * JOINED_MM
                        elif abs(dx) <= 1.5 * step:
                            side = int(dx > 0)
                            if distance < nearest[side]:
                                nearest[side], vector[side, 0], vector[side, 1] = distance, dy, dz
        if nearest.max() < REACH_MM * REACH_MM:
            away[n] = 0.5 * math.hypot(vector[0, 0] + vector[1, 0], vector[0, 1] + vector[1, 1])
    return away, joined

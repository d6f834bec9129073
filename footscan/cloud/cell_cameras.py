"""Which cameras have points in the cells around a place."""

import numpy as np
from numpy.typing import NDArray

from footscan.compiled import compiled
from footscan.mesh.voxels import EMPTY

Ints = NDArray[np.int32]


@compiled
def cameras_near(number: Ints, seen: NDArray[np.uint64], place: Ints) -> np.uint64:
    """The bits of the cameras that `seen` (V,) has in a cell or in its 26 neighbours."""
    cameras = np.uint64(0)
    for i in range(place[0] - 1, place[0] + 2):
        for j in range(place[1] - 1, place[1] + 2):
            for k in range(place[2] - 1, place[2] + 2):
                if number[i, j, k] != EMPTY:
                    cameras |= seen[number[i, j, k]]
    return cameras


@compiled
def cameras_around(number: Ints, seen: NDArray[np.uint64], place: Ints) -> NDArray[np.uint64]:
    """(V,) `cameras_near` of each numbered cell."""
    near = np.empty(len(place), np.uint64)
    for v in range(len(place)):
        near[v] = cameras_near(number, seen, place[v])
    return near

"""Which cameras should see a point, and whether they do.

A camera should see what lies in its calibrated part of the laser's plane, faces it and is not hidden. Where it sees
nothing there although its picture of this plane is not empty, or where it sees something behind, the point is denied.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.planes import SUMS, add_point, plane_normal
from footscan.cloud.views import View
from footscan.compiled import compiled
from footscan.mesh.voxels import EMPTY, Voxels

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

UNKNOWN, CONFIRMED, DENIED = range(3)
"""What the other cameras say of a point."""
FACING, AS_WELL, GRAZING = 0.4, 0.7, 0.15
"""Cosine of the angle to a surface's normal up to which a camera is expected to see a stripe; where the camera that saw
it has less, this part of its cosine, but never less than the last one."""
FLAT = 0.3
"""Variance across a plane, in parts of that along it, above which the plane means nothing."""
OUTLINE_MM = 3.0
"""How far inside its outline a camera is expected to see."""
CLEARANCE_CELLS = 4.0
"""A point is not hidden by what is so close to it: its own surface."""
BEFORE_CELLS, BEHIND_CELLS = 3.0, 4.0
"""What others see at least so far before a point hides it; what a camera sees so far behind, it sees through it."""
FARTHEST_BEHIND = 0.5
"""How far behind is looked for, in distances of the camera from its laser's plane."""


class Sight(NamedTuple):
    """What all cameras saw, by cells."""

    seen: NDArray[np.uint64]
    """(V,): bit k stands for camera k of the list, which has points in the cell."""
    normals: Floats
    """(V, 3): of the surface in and around a cell, either way; 0 where there is no telling."""
    films: NDArray[np.bool_]
    """(cells in X, cameras): whether a camera has points there at all."""
    solid: NDArray[np.bool_]
    """Cells of twice the size that hold points."""


class Eyes(NamedTuple):
    """Where cameras stand and what they can see."""

    centres: Floats
    """(C, 3) mm; NaN where a camera's place is not known."""
    sides: Floats
    """As `_sides` gives them, of all cameras one after the other."""
    bounds: NDArray[np.int64]
    """(C + 1,): where the sides of each camera begin."""


def sight_of(xyz: Floats, camera: NDArray[np.uint8], cameras: int, voxels: Voxels) -> Sight:
    """Sums up points (N, 3); `camera` (N,) is the place of each one's camera in a list of so many."""
    seen, films, normals = _sum_up(xyz, camera, cameras, voxels.number, voxels.voxel, voxels.place)
    solid = np.zeros([side // 2 + 1 for side in voxels.number.shape], np.bool_)
    solid[tuple(voxels.place.T // 2)] = True
    return Sight(seen, normals, films, solid)


def ask_others(
    xyz: Floats, camera: NDArray[np.uint8], voxel: Ints, views: list[View | None], voxels: Voxels, sight: Sight
) -> NDArray[np.uint8]:
    """For each point (N,) whether another camera confirms it, or one that should see it denies it.

    Parameters
    ----------
    xyz, camera, voxel : (N, 3) mm, scanner frame; the place of its camera in `views`; the number of its cell
    views : of each camera of the list, where it is known
    """
    centres = np.array([np.full(3, np.nan) if view is None else view.centre for view in views])
    sides = [_sides(view) for view in views]
    bounds = np.concatenate([[0], np.cumsum([len(side) for side in sides])])
    return _ask(xyz, camera, voxel, Eyes(centres, np.concatenate(sides), bounds), voxels, sight)


def _sides(view: View | None) -> Floats:
    """(M, 3): inward unit normals of the sides of a view's outline in Y and Z, and their distance from the origin."""
    if view is None or not len(view.outline):
        return np.array([[0.0, 0.0, np.inf]])  # nothing is inside
    along = np.roll(view.outline, -1, axis=0) - view.outline
    inward = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(along[:, 0], along[:, 1])[:, None]
    return np.column_stack([inward, np.sum(inward * view.outline, axis=1) + OUTLINE_MM])


@compiled
def _sum_up(
    xyz: Floats, camera: NDArray[np.uint8], cameras: int, number: Ints, voxel: Ints, place: Ints
) -> tuple[NDArray[np.uint64], NDArray[np.bool_], Floats]:
    count = len(place)
    seen = np.zeros(count, np.uint64)
    films = np.zeros((number.shape[0], cameras), np.bool_)
    sums = np.zeros((count, SUMS))
    for n in range(len(xyz)):
        v = voxel[n]
        seen[v] |= np.uint64(1) << np.uint64(camera[n])
        films[place[v, 0], camera[n]] = True
        add_point(sums[v], xyz[n, 0], xyz[n, 1], xyz[n, 2], 1.0)
    normals = np.empty((count, 3))
    around = np.empty(SUMS)
    for v in range(count):
        around[:] = 0.0
        a, b, c = place[v]
        for i in range(a - 1, a + 2):
            for j in range(b - 1, b + 2):
                for k in range(c - 1, c + 2):
                    if number[i, j, k] != EMPTY:
                        around += sums[number[i, j, k]]
        nx, ny, nz, across, along = plane_normal(around)
        flat = across < FLAT * along
        normals[v, 0], normals[v, 1], normals[v, 2] = (nx, ny, nz) if flat else (0.0, 0.0, 0.0)
    return seen, films, normals


@compiled
def _ask(
    xyz: Floats,
    camera: NDArray[np.uint8],
    voxel: Ints,
    eyes: Eyes,
    voxels: Voxels,
    sight: Sight,
) -> NDArray[np.uint8]:
    centres, sides, bounds = eyes
    origin, size, number, _, place = voxels
    seen, normals, films, solid = sight
    answers = np.zeros(len(xyz), np.uint8)
    for n in range(len(xyz)):
        x, y, z = xyz[n]
        v = voxel[n]
        own = np.uint64(1) << np.uint64(camera[n])
        if cameras_near(number, seen, place[v]) & ~own:
            answers[n] = CONFIRMED
            continue
        nx, ny, nz = normals[v]
        dx, dy, dz = centres[camera[n], 0], centres[camera[n], 1] - y, centres[camera[n], 2] - z
        to_own = nx * dx + ny * dy + nz * dz
        facing_own = 0.0 if np.isnan(to_own) else np.sign(to_own)
        own_cosine = abs(to_own) / np.sqrt(dx * dx + dy * dy + dz * dz)
        facing = max(min(FACING, AS_WELL * own_cosine), GRAZING)
        if not np.isnan(to_own) and _behind_surface(x, y, z, dx, dy, dz, voxels, seen, ~own):
            answers[n] = DENIED
            continue
        nx, ny, nz = facing_own * nx, facing_own * ny, facing_own * nz
        for b in range(len(centres)):
            if b == camera[n] or not films[place[v, 0], b]:
                continue
            if not _inside(y, z, sides[bounds[b] : bounds[b + 1]]):
                continue
            if _sees_behind(x, y, z, centres[b], b, origin, size, number, seen):
                answers[n] = DENIED
                break
            dx, dy, dz = centres[b, 0], centres[b, 1] - y, centres[b, 2] - z
            if nx * dx + ny * dy + nz * dz < facing * np.sqrt(dx * dx + dy * dy + dz * dz):
                continue
            if not _hidden(x, y, z, dx, dy, dz, origin, size, solid):
                answers[n] = DENIED
                break
    return answers


@compiled
def cameras_near(number: Ints, seen: NDArray[np.uint64], place: Ints) -> np.uint64:
    """Those of the cameras that `seen` (V,) has in a cell, or beside it, bit by bit."""
    found = np.uint64(0)
    for i in range(place[0] - 1, place[0] + 2):
        for j in range(place[1] - 1, place[1] + 2):
            for k in range(place[2] - 1, place[2] + 2):
                if number[i, j, k] != EMPTY:
                    found |= seen[number[i, j, k]]
    return found


@compiled
def _inside(y: float, z: float, sides: Floats) -> bool:
    inside = True
    for m in range(len(sides)):
        inside &= sides[m, 0] * y + sides[m, 1] * z >= sides[m, 2]
    return inside


@compiled
def _hidden(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, origin: Floats, size: Floats,
    solid: NDArray[np.bool_],
) -> bool:  # fmt: skip
    """Whether a cell with points lies on the way (dx, dy, dz) that leads from a point to a camera."""
    stride = size[1] / np.sqrt(dx * dx + dy * dy + dz * dz)
    part = CLEARANCE_CELLS * stride
    while part < 1.0:
        a = int((x + part * dx - origin[0]) / size[0]) >> 1
        b = int((y + part * dy - origin[1]) / size[1]) >> 1
        c = int((z + part * dz - origin[2]) / size[2]) >> 1
        if not (0 <= a < solid.shape[0] and 0 <= b < solid.shape[1] and 0 <= c < solid.shape[2]):
            return False
        if solid[a, b, c]:
            return True
        part += stride
    return False


@compiled
def _behind_surface(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, voxels: Voxels,
    seen: NDArray[np.uint64], others: np.uint64,
) -> bool:  # fmt: skip
    """Whether what other cameras saw lies on the way (dx, dy, dz) from a point to the camera that says it saw it."""
    origin, size, number, _, _ = voxels
    stride = 0.5 * size[1] / np.sqrt(dx * dx + dy * dy + dz * dz)
    part = BEFORE_CELLS * 2.0 * stride
    while part < 1.0:
        a = int((x + part * dx - origin[0]) / size[0])
        b = int((y + part * dy - origin[1]) / size[1])
        c = int((z + part * dz - origin[2]) / size[2])
        if not (0 <= a < number.shape[0] and 0 <= b < number.shape[1] and 0 <= c < number.shape[2]):
            return False
        found = number[a, b, c]
        if found != EMPTY and seen[found] & others:
            return True
        part += stride
    return False


@compiled
def _sees_behind(
    x: float, y: float, z: float, centre: Floats, camera: int, origin: Floats, size: Floats, number: Ints,
    seen: NDArray[np.uint64],
) -> bool:  # fmt: skip
    """Whether a camera, as it travelled, saw something through a point.

    With the laser's plane at x + s it stands s farther on, and the line of sight through the point arrives at the plane
    at a place that moves away behind the point with s.
    """
    towards = centre[0]
    bit = np.uint64(1) << np.uint64(camera)
    distance = np.sqrt(towards**2 + (centre[1] - y) ** 2 + (centre[2] - z) ** 2)
    step = -size[0] if towards > 0 else size[0]
    s = step
    while abs(s) < FARTHEST_BEHIND * abs(towards):
        stretch = towards / (towards + s)
        a = int((x + s - origin[0]) / size[0])
        b = int((centre[1] + stretch * (y - centre[1]) - origin[1]) / size[1])
        c = int((centre[2] + stretch * (z - centre[2]) - origin[2]) / size[2])
        if not (0 <= a < number.shape[0] and 0 <= b < number.shape[1] and 0 <= c < number.shape[2]):
            return False
        found = number[a, b, c]
        if found != EMPTY and seen[found] & bit and (stretch - 1) * distance > BEHIND_CELLS * size[1]:
            return True
        s += step
    return False

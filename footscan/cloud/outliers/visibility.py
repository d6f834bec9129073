"""Confirmation and denial of points by the cameras that should see them.

A camera should see a point that lies in its calibrated part of the laser plane, faces it and is not hidden. It denies
the point if it has filmed this plane and sees nothing there, or if it sees something behind. A point is denied, too, if
it lies behind a surface that more cameras see: the camera that saw it looked through the surface, at a reflection.
Cameras that miss most of what they should see deny nothing.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.cell_cameras import cameras_around, cameras_near
from footscan.cloud.planes import SUMS, add_point, plane_normal
from footscan.cloud.views import View
from footscan.compiled import compiled
from footscan.mesh.voxels import EMPTY, Voxels
from footscan.side_by_side import Arrays, in_pieces

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

UNKNOWN, CONFIRMED, DENIED = range(3)
"""The answers of the other cameras for a point."""
FACING, AS_WELL, GRAZING = 0.4, 0.7, 0.15
"""Least cosine between a surface's normal and the direction to a camera at which the camera is expected to see the
stripe: the first number, or the second times the cosine of the camera that saw it if that is less, but never less than
the third. Chosen by hand."""
FLAT = 0.3
"""Variance across a plane, relative to that along it, from which the plane has no normal. Chosen by hand."""
OUTLINE_MM = 3.0
"""Margin inside its outline in which a camera is not expected to see. Chosen by hand."""
CLEARANCE_CELLS = 4.0
"""Distance within which points do not hide a point: they are its own surface. Chosen by hand."""
BEFORE_CELLS, BEHIND_CELLS = 3.0, 4.0
"""Distances, in sides of a cell, from which points of other cameras in front of a point hide it, and from which a
camera that sees points behind it sees through it. Chosen by hand."""
HIDDEN_CELLS = 5.0
"""Distance, in sides of a cell, from which surface that more cameras confirm hides a point. Chosen by hand."""
PIERCED = 0.2
"""Least cosine between a line and the normal of a surface that it passes through; a flatter one passes along skin that
bulges. Tuned on the film `left-coloured` of `regression/suite.yaml` and two virtual scanners' points. Of five others,
45 to 88 % of the right points that were denied without it are kept, at 2 and at 4 mm between stripes."""
FARTHEST_BEHIND = 0.5
"""Distance behind a point that is searched, in distances of the camera from the laser plane: a bound of time."""
SAMPLED = 8
"""Every so many points are asked whether a camera is a witness: a bound of time."""
WITNESS_SHARE = 0.5
"""A camera denies nothing if it sees less than this share of what it should see, as if it were dark or knocked."""


class Sight(NamedTuple):
    """The points of all cameras, by cells."""

    seen: NDArray[np.uint64]
    """(V,): bit k is set if camera k of the list has points in the cell."""
    normals: Floats
    """(V, 3): normal of the surface in and around a cell, of either sign; 0 if it is not determined."""
    films: NDArray[np.bool_]
    """(cells in X, cameras): True if the camera has filmed at this X."""
    solid: NDArray[np.uint64]
    """As `seen`, for all cells of twice the size; 0 where there are no points."""


class Eyes(NamedTuple):
    """Positions and outlines of the cameras."""

    centres: Floats
    """(C, 3) mm; NaN for a camera of unknown position."""
    sides: Floats
    """(S, 3): the sides of all outlines, camera by camera, as `_sides` returns them."""
    bounds: NDArray[np.int64]
    """(C + 1,): where the sides of each camera begin."""
    heads: NDArray[np.int64]
    """(C,): those of the cameras; 0 where no film has shown the laser planes, which then count as one."""


def sight_of(
    xyz: Floats, camera: NDArray[np.uint8], filmed: Sequence[NDArray[np.float64] | None], voxels: Voxels
) -> Sight:
    """Sum up the points of all cameras by cells.

    Parameters
    ----------
    xyz : (N, 3) mm, scanner frame
    camera : (N,) index of each point's camera in `filmed`, which has 64 cameras at most
    filmed : for each camera, X of its frames, mm; None if they are not known: then only those with points count
    voxels : the cells of the points
    """
    seen, films, normals = _sum_up(xyz, camera, len(filmed), voxels.number, voxels.voxel, voxels.place)
    for k, x in enumerate(filmed):
        if x is not None:
            cells = ((x[np.isfinite(x)] - voxels.origin[0]) / voxels.size[0]).astype(np.int64)
            films[cells[(cells >= 0) & (cells < len(films))], k] = True
    solid = np.zeros([side // 2 + 1 for side in voxels.number.shape], np.uint64)
    np.bitwise_or.at(solid, tuple(voxels.place.T // 2), seen)
    return Sight(seen, normals, films, solid)


def ask_others(
    xyz: Floats, camera: NDArray[np.uint8], voxel: Ints, views: list[View | None], voxels: Voxels, sight: Sight
) -> NDArray[np.uint8]:
    """Ask the other cameras about each point.

    Parameters
    ----------
    xyz : (N, 3) mm, scanner frame
    camera : (N,) index of each point's camera in `views`
    voxel : (N,) number of each point's cell
    views : the view of each camera; None if it is unknown

    Returns
    -------
    (N,) uint8: `CONFIRMED` if another camera sees the point, `DENIED` if one that should see it does not, or if it is
    behind a surface that more cameras see, else `UNKNOWN`.
    """
    centres = np.array([np.full(3, np.nan) if view is None else view.centre for view in views])
    sides = [_sides(view) for view in views]
    bounds = np.concatenate([[0], np.cumsum([len(side) for side in sides])])
    heads = np.array([0 if view is None or view.plane is None else view.plane.head for view in views])
    eyes = Eyes(centres, np.concatenate(sides), bounds, heads)
    is_witness = _witnesses(xyz, camera, voxel, eyes, voxels, sight)
    near = cameras_around(voxels.number, sight.seen, voxels.place)

    def answered(rows: slice) -> Arrays:
        return (_ask(xyz[rows], camera[rows], voxel[rows], eyes, voxels, sight, is_witness, near),)

    return in_pieces(len(xyz), answered)[0]


def _sides(view: View | None) -> Floats:
    """(M, 3): inward unit normals of the sides of a view's outline in Y and Z, and their distance from the origin."""
    if view is None or not len(view.outline):
        return np.array([[0.0, 0.0, np.inf]])  # no point is inside
    along = np.roll(view.outline, -1, axis=0) - view.outline
    inward = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(along[:, 0], along[:, 1])[:, None]
    return np.column_stack([inward, np.sum(inward * view.outline, axis=1) + OUTLINE_MM])


@compiled
def _sum_up(
    xyz: Floats, camera: NDArray[np.uint8], cameras: int, number: Ints, voxel: Ints, place: Ints
) -> tuple[NDArray[np.uint64], NDArray[np.bool_], Floats]:
    """The fields `seen`, `films` and `normals` of `Sight`."""
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


class Line(NamedTuple):
    """From a point to a camera: the point and the difference of both, mm."""

    x: float
    y: float
    z: float
    dx: float
    dy: float
    dz: float


@compiled
def _ask(
    xyz: Floats,
    camera: NDArray[np.uint8],
    voxel: Ints,
    eyes: Eyes,
    voxels: Voxels,
    sight: Sight,
    is_witness: NDArray[np.bool_],
    near: NDArray[np.uint64],
) -> NDArray[np.uint8]:
    """The answers of `ask_others`; is_witness (C,) as of `_witnesses`, near (V,) as of `cameras_around`."""
    centres, sides, bounds, heads = eyes
    origin, size, number, _, place = voxels
    seen, normals, films, solid = sight
    answers = np.zeros(len(xyz), np.uint8)
    for n in range(len(xyz)):
        x, y, z = xyz[n]
        v = voxel[n]
        own = np.uint64(1) << np.uint64(camera[n])
        line = _line(x, y, z, centres[camera[n]])
        if near[v] & ~own:
            is_hidden = _behind_surface(line, HIDDEN_CELLS, voxels, near, own, _count(near[v] & ~own), normals)
            answers[n] = DENIED if is_hidden else CONFIRMED
            continue
        if _behind_surface(line, BEFORE_CELLS, voxels, seen, own, 0, normals):
            answers[n] = DENIED
            continue
        normal, facing = _towards(normals[v], line)
        goes_on = _goes_on(number, place[v])
        for b in range(len(centres)):
            if b == camera[n] or not films[place[v, 0], b] or not is_witness[b]:
                continue
            if heads[b] != heads[camera[n]] and not goes_on:
                continue  # a plane beside that of the point may pass the tip of a toe
            if not _inside(y, z, sides[bounds[b] : bounds[b + 1]]):
                continue
            if _sees_behind(x, y, z, centres[b], b, origin, size, number, seen):
                answers[n] = DENIED
                break
            if _should_see(_line(x, y, z, centres[b]), normal, facing, voxels, solid, np.uint64(1) << np.uint64(b)):
                answers[n] = DENIED
                break
    return answers


@compiled
def _line(x: float, y: float, z: float, centre: Floats) -> Line:
    """The line from a point to a camera, whose `centre` is that of its frame in this plane."""
    return Line(x, y, z, centre[0], centre[1] - y, centre[2] - z)


@compiled
def _towards(normal: Floats, line: Line) -> tuple[Floats, float]:
    """The normal on the side of the camera that saw the point, to which the line leads; 0 if that is unknown.

    Also the least cosine between it and the direction to another camera that should see the point as well.
    """
    to_own = normal[0] * line.dx + normal[1] * line.dy + normal[2] * line.dz
    if np.isnan(to_own):
        return 0.0 * normal, GRAZING
    own_cosine = abs(to_own) / _length(line)
    return np.sign(to_own) * normal, max(min(FACING, AS_WELL * own_cosine), GRAZING)


@compiled
def _length(line: Line) -> float:
    return float(np.sqrt(line.dx * line.dx + line.dy * line.dy + line.dz * line.dz))


@compiled
def _should_see(
    line: Line, normal: Floats, facing: float, voxels: Voxels, solid: NDArray[np.uint64], bit: np.uint64
) -> bool:
    """True if a point faces the camera to which the line leads, whose bit is `bit`, and nothing hides it."""
    if normal[0] * line.dx + normal[1] * line.dy + normal[2] * line.dz < facing * _length(line):
        return False
    return not _hidden(line, voxels, solid, bit)


@compiled
def _witnesses(
    xyz: Floats, camera: NDArray[np.uint8], voxel: Ints, eyes: Eyes, voxels: Voxels, sight: Sight
) -> NDArray[np.bool_]:
    """(C,) True for cameras that see most of what they should see of the surface that two others agree on."""
    centres, sides, bounds, _ = eyes
    _, _, number, _, place = voxels
    seen, normals, films, solid = sight
    should, does = np.zeros(len(centres)), np.zeros(len(centres))
    for n in range(0, len(xyz), SAMPLED):
        x, y, z = xyz[n]
        v = voxel[n]
        near = cameras_near(number, seen, place[v])
        normal, facing = _towards(normals[v], _line(x, y, z, centres[camera[n]]))
        for b in range(len(centres)):
            others = near & ~(np.uint64(1) << np.uint64(b))
            if not others & (others - np.uint64(1)) or not films[place[v, 0], b]:
                continue
            if not _inside(y, z, sides[bounds[b] : bounds[b + 1]]):
                continue
            if _should_see(_line(x, y, z, centres[b]), normal, facing, voxels, solid, np.uint64(1) << np.uint64(b)):
                should[b] += 1
                does[b] += others != near
    return does >= WITNESS_SHARE * should


@compiled
def _goes_on(number: Ints, place: Ints) -> bool:
    """True if there are points on both sides of a cell along the travel."""
    behind, before = False, False
    for j in range(place[1] - 1, place[1] + 2):
        for k in range(place[2] - 1, place[2] + 2):
            behind |= number[place[0] - 1, j, k] != EMPTY
            before |= number[place[0] + 1, j, k] != EMPTY
    return behind and before


@compiled
def _inside(y: float, z: float, sides: Floats) -> bool:
    """True if (y, z) lies on the inner side of all `sides` (M, 3)."""
    inside = True
    for m in range(len(sides)):
        inside &= sides[m, 0] * y + sides[m, 1] * z >= sides[m, 2]
    return inside


@compiled
def _hidden(line: Line, voxels: Voxels, solid: NDArray[np.uint64], bit: np.uint64) -> bool:
    """True if surface lies on the line from a point to a camera, whose bit is `bit`.

    Surface is where this camera has points, or where two others have: what a single other camera sees may be clutter.
    """
    origin, size, _, _, _ = voxels
    stride = size[1] / _length(line)
    part = CLEARANCE_CELLS * stride
    while part < 1.0:
        a = int((line.x + part * line.dx - origin[0]) / size[0]) >> 1
        b = int((line.y + part * line.dy - origin[1]) / size[1]) >> 1
        c = int((line.z + part * line.dz - origin[2]) / size[2]) >> 1
        if not (0 <= a < solid.shape[0] and 0 <= b < solid.shape[1] and 0 <= c < solid.shape[2]):
            return False
        there = solid[a, b, c]
        if there & bit or there & (there - np.uint64(1)):
            return True
        part += stride
    return False


@compiled
def _behind_surface(
    line: Line, clearance: float, voxels: Voxels, seen: NDArray[np.uint64], own: np.uint64, least: int, normals: Floats
) -> bool:
    """True if surface lies on the line from a point to the camera that saw it, whose bit is `own`.

    Surface is where more than `least` other cameras have points, farther than `clearance` cells from the point.
    """
    if np.isnan(line.dx + line.dy + line.dz):
        return False
    origin, size, number, _, _ = voxels
    stride = 0.5 * size[1] / _length(line)
    part = clearance * 2.0 * stride
    while part < 1.0:
        a = int((line.x + part * line.dx - origin[0]) / size[0])
        b = int((line.y + part * line.dy - origin[1]) / size[1])
        c = int((line.z + part * line.dz - origin[2]) / size[2])
        if not (0 <= a < number.shape[0] and 0 <= b < number.shape[1] and 0 <= c < number.shape[2]):
            return False
        cell = number[a, b, c]
        if cell != EMPTY and _count(seen[cell] & ~own) > least and _passes_through(line, normals[cell]):
            return True
        part += stride
    return False


@compiled
def _passes_through(line: Line, normal: Floats) -> bool:
    """True if a line passes through a surface rather than along it; False if the normal is not determined."""
    through = abs(normal[0] * line.dx + normal[1] * line.dy + normal[2] * line.dz)
    return bool(through >= PIERCED * _length(line))


@compiled
def _count(bits: np.uint64) -> int:
    """Number of the bits that are set."""
    count = 0
    while bits:
        bits &= bits - np.uint64(1)
        count += 1
    return count


@compiled
def _sees_behind(
    x: float, y: float, z: float, centre: Floats, camera: int, origin: Floats, size: Floats, number: Ints,
    seen: NDArray[np.uint64],
) -> bool:  # fmt: skip
    """True if a camera saw points behind a point at another place of its travel.

    With the laser plane at x + s the camera is s farther on. Its line of sight through the point then meets the plane
    behind the point, the farther away the larger s is.
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
        cell = number[a, b, c]
        if cell != EMPTY and seen[cell] & bit and (stretch - 1) * distance > BEHIND_CELLS * size[1]:
            return True
        s += step
    return False

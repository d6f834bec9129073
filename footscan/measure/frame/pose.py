"""The pose of a foot in any position and unit: where its sole, its heel and its toes are.

A body rests on faces of its convex hull. The large faces of a foot's hull are the sole, the cut through the leg, both
sides and the slope from the leg to the toes. Of these the sole touches the floor with the largest area of skin.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from footscan.compiled import compiled
from footscan.mesh.sections import face_neighbours
from footscan.mesh.topology import vertex_normals_and_areas
from schemas.base.errors import Finding

Floats = NDArray[np.float64]

CANDIDATES, LARGEST = 12, 7
"""Number of flat parts of the hull that are considered; the first so many of them, the largest, may be the sole. Chosen
by hand."""
COARSE, SAME_FACE_DEG = 8, 8.0
"""Grid of directions in which faces of the hull are first grouped; largest angle between faces of one flat part. Chosen
by hand."""
FACING = 0.85
"""Skin faces the floor if the cosine between its normal and the downward direction exceeds this; chosen by hand."""
TOUCHING = 0.02
"""Skin nearer than this to the floor touches it, as a share of the footprint's length: 5 mm on a foot of 260 mm. Chosen
by hand."""
LOW = 0.24
"""Height below which there is foot and no leg, as a share of the footprint's length; chosen by hand."""
TOES = 0.85
"""Share of the length ahead of which the toes lie; chosen by hand."""
SLENDER, UNLIKELY = 1.5, 0.05
"""A footprint is longer than broad by the first factor; the score of any other face is multiplied by the second. Chosen
by hand."""
FLAT = 0.004
"""Largest scatter about the floor of a foot that stands on its sole, as a share of the length: 1 mm on 260 mm.
Chosen by hand."""
SOLE_LENGTH, SOLE_BREADTH = 0.5, 0.2
"""Least extent of a sole along and across the foot, as shares of the length; chosen by hand."""
LEAST_REACH = 2e-4
"""Least distance from the floor at which skin counts, as a share of the length: 0.05 mm on 260 mm. Chosen by hand."""
SCATTERS_WIDE = 4.0
"""Skin farther from the floor than this number of standard deviations does not count; chosen by hand."""
FLOOR_ROUNDS = 60
"""Bound of time: rounds of the fit of the floor."""
LID_FACING, LID_FLAT, LID_AREA, LID_HEIGHT = 0.6, 0.004, 0.012, 0.15
"""The end of a leg looks up by more than this cosine, is flat to this share of the length, has at least this share of
the squared length as area (800 mm² on a foot of 260 mm), and lies at least this share of the length above the floor.
Chosen by hand."""


class Pose(NamedTuple):
    """A foot on its floor."""

    transform: Floats
    """(4, 4) from the mesh's frame: floor at Z = 0, Z up, X from heel to toes along the footprint; in the same unit"""
    length: float
    """Approximate foot length."""
    residual: float
    """Standard deviation of the skin on the floor about it."""
    stands: bool
    """True if a flat sole lies on the floor; False if the foot touches it at some points only."""
    convexity: float
    """Volume over that of the convex hull: 1 for a ball, a block or an egg."""
    leg_end: Floats | None
    """(N, 3) vertices of the flat end of the cut leg, in the mesh's frame; None without such an end."""

    def scaled(self, factor: float) -> "Pose":
        """The pose of a mesh whose coordinates are those of this one times a factor."""
        transform = self.transform.copy()
        transform[:3, 3] *= factor
        end = None if self.leg_end is None else factor * self.leg_end
        return Pose(transform, factor * self.length, factor * self.residual, self.stands, self.convexity, end)


def find_pose(vertices: Floats, faces: NDArray[np.integer], up: Floats | None = None) -> Pose:
    """Find the pose of a foot's mesh in any position and unit. Left and right feet are treated alike.

    Parameters
    ----------
    vertices : (V, 3) float64, any unit
    faces : (F, 3), all looking outward or all inward
    up : (3,) unit vector, about upwards; default: follows from the form

    Raises
    ------
    Finding
        The mesh has no volume.
    """
    try:
        hull = ConvexHull(vertices)
    except (QhullError, ValueError):
        raise Finding("the surface is flat or has no points, expected a foot") from None
    inside = volume(vertices, faces)
    skin = _skin(vertices, faces if inside >= 0 else faces[:, ::-1])
    candidates = _hull_faces(vertices, hull)
    downs = [normal for normal, _ in candidates[:LARGEST]] if up is None else [-up]
    best = max((_standing(vertices, skin, -down) for down in downs), key=lambda standing: standing.score)
    upwards, offset, residual, stands = _floor(vertices, skin, hull, best)
    transform = _standing_transform(vertices, upwards, offset, best)
    end = _leg_end(vertices, candidates, transform, best.length)
    return Pose(transform, best.length, residual, stands, abs(inside) / float(hull.volume), end)


def volume(vertices: Floats, faces: NDArray[np.integer]) -> float:
    """Volume of a closed mesh, negative if its faces look inwards; for an open mesh, about the volume it encloses.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> round(volume(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])), 6)
    0.166667
    """
    return _volume(vertices - vertices.mean(axis=0), np.ascontiguousarray(faces, np.int64))


@compiled
def _volume(vertices: Floats, faces: NDArray[np.int64]) -> float:
    total = 0.0
    for face in range(len(faces)):
        a, b, c = vertices[faces[face, 0]], vertices[faces[face, 1]], vertices[faces[face, 2]]
        total += a[0] * (b[1] * c[2] - b[2] * c[1])
        total += a[1] * (b[2] * c[0] - b[0] * c[2])
        total += a[2] * (b[0] * c[1] - b[1] * c[0])
    return total / 6


class _Skin(NamedTuple):
    normals: Floats
    """(V, 3) unit"""
    areas: Floats
    """(V,) a third of the area of the triangles around each vertex"""
    rims: Floats
    """(E, 2, 3) ends of open edges, the surface on their left"""


def _skin(vertices: Floats, faces: NDArray[np.integer]) -> _Skin:
    return _Skin(*vertex_normals_and_areas(vertices, faces), _rims(vertices, faces))


def _rims(vertices: Floats, faces: NDArray[np.integer]) -> Floats:
    corners = np.ascontiguousarray(faces, np.int64)
    alone, slot = np.nonzero(face_neighbours(corners, len(vertices)) < 0)
    return np.stack([vertices[corners[alone, slot]], vertices[corners[alone, (slot + 1) % 3]]], axis=1)


def _open_area(rims: Floats, up: Floats, reach: float) -> float:
    """Area of the openings at the floor, where a scanner could not see the sole."""
    if not len(rims):
        return 0.0
    height = rims @ up
    on_floor = rims[(height < height.min() + reach).all(axis=1)]
    if not len(on_floor):
        return 0.0
    on_floor = on_floor - on_floor.mean(axis=(0, 1))
    return max(float(np.cross(on_floor[:, 0], on_floor[:, 1]).sum(axis=0) @ up) / 2, 0.0)


def _hull_faces(vertices: Floats, hull: ConvexHull) -> list[tuple[Floats, float]]:
    """Returns the outward normals and areas of the largest nearly flat parts of the hull."""
    corners = vertices[hull.simplices]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.sqrt(np.einsum("ni,ni->n", crosses, crosses)) / 2
    normals = hull.equations[:, :3]
    # A flat part is cut into many triangles, which are grouped by their direction.
    coarse = (np.rint(normals * COARSE) + COARSE).astype(np.int64) @ (2 * COARSE + 1) ** np.arange(3)
    left, faces = areas.copy(), []
    for _ in range(CANDIDATES):
        together = coarse == np.argmax(np.bincount(coarse, left))
        normal = (normals[together] * left[together, None]).sum(axis=0)
        if not np.linalg.norm(normal) > 0:
            break
        same = normals @ normal > np.cos(np.deg2rad(SAME_FACE_DEG)) * np.linalg.norm(normal)
        normal = (normals[same] * left[same, None]).sum(axis=0)
        faces.append((normal / np.linalg.norm(normal), float(left[same].sum())))
        left[same | together] = 0.0
    return faces


class _Standing(NamedTuple):
    score: float
    up: Floats
    along: Floats
    """(3,) unit vector along the footprint, from heel to toes"""
    length: float


def _standing(vertices: Floats, skin: _Skin, up: Floats) -> _Standing:
    """Score how well a foot would stand with `up` upwards, by the skin that touches the floor and by its form."""
    height = vertices @ up
    height = height - height.min()
    flat = vertices @ _across(up)
    first, second = np.ascontiguousarray(flat.T)
    low = height <= LOW * np.hypot(np.ptp(first), np.ptp(second))
    for _ in range(2):
        _, spread = _spread(flat, np.where(low, np.maximum(skin.areas, 1e-12), 0.0))
        direction = np.linalg.eigh(spread)[1][:, -1]
        x, y = direction[0] * first + direction[1] * second, direction[0] * second - direction[1] * first
        length = float(np.ptp(x[low]))
        low = height <= LOW * length
    x = x - x[low].min()
    rear, front = (height[part].max(initial=0.0) for part in (x < length / 4, x > 3 * length / 4))
    toes = height[x > TOES * length if rear >= front else x < (1 - TOES) * length].max(initial=0.0)
    touching = (height <= TOUCHING * length) & (skin.normals @ up < -FACING)
    score = float(skin.areas[touching].sum()) + _open_area(skin.rims, up, TOUCHING * length)
    score *= 1.0 - toes / max(rear, front)
    score *= 1.0 if length > SLENDER * np.ptp(y[low]) else UNLIKELY
    along = _across(up) @ direction
    return _Standing(score, up, along if rear >= front else -along, length)


def _across(up: Floats) -> Floats:
    """Returns (3, 2) two unit vectors that form a right-handed frame with `up`."""
    first = np.cross(np.eye(3)[np.argmin(np.abs(up))], up)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(up, first)])


@compiled
def _spread(points: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Returns the weighted mean (D,) and covariance (D, D) of (N, D) points; some of the (N,) weights are not 0."""
    size = points.shape[1]
    middle, covariance, total = np.zeros(size), np.zeros((size, size)), weights.sum()
    for k in range(len(points)):
        if weights[k] > 0:
            for i in range(size):
                middle[i] += weights[k] / total * points[k, i]
    for k in range(len(points)):
        if weights[k] > 0:
            for i in range(size):
                for j in range(size):
                    covariance[i, j] += weights[k] / total * (points[k, i] - middle[i]) * (points[k, j] - middle[j])
    return middle, covariance


def _floor(vertices: Floats, skin: _Skin, hull: ConvexHull, standing: _Standing) -> tuple[Floats, float, float, bool]:
    """Returns the upward normal of the floor, its height, the scatter of the skin on it, and whether a sole lies there.

    A plane is fitted to the skin that faces down, in an ever narrower range about it, so that the arch and the rounded
    edge of the sole drop out. If the remaining skin is too small for a sole, the floor is the face of the hull on which
    the foot rests.
    """
    up, length = standing.up, standing.length
    facing = skin.normals @ up < -0.5  # a few degrees of tilt do not matter here
    places, normals, areas = vertices[facing], skin.normals[facing], skin.areas[facing]
    offset, reach = float((vertices @ up).min()) + TOUCHING * length / 2, TOUCHING * length
    scatter, weights = 0.0, np.zeros(len(places))
    for _ in range(FLOOR_ROUNDS):
        away = (places @ up - offset) / reach
        down = np.clip((-(normals @ up) - FACING) / (1.0 - FACING), 0.0, 1.0)
        weights = areas * down * np.clip(1.0 - away**2, 0.0, None) ** 2
        if np.count_nonzero(weights) < 3:
            break
        middle, spread = _spread(places, weights)
        _, directions = np.linalg.eigh(spread)
        fitted = directions[:, 0] if directions[:, 0] @ up > 0 else -directions[:, 0]
        change = float(np.linalg.norm(fitted - up)) + abs(float(middle @ fitted) - offset) / length
        up, offset = fitted, float(middle @ fitted)
        scatter = float(np.sqrt(weights @ (places @ up - offset) ** 2 / weights.sum()))
        narrower = max(SCATTERS_WIDE * scatter, LEAST_REACH * length)
        if narrower >= 0.99 * reach and change < 1e-9:
            break
        reach = min(reach, narrower)
    if _is_sole(places[weights > 0], standing, scatter):
        return up, offset, scatter, True
    return *_resting(hull, vertices, standing), scatter, False


def _is_sole(places: Floats, standing: _Standing, scatter: float) -> bool:
    """True if the points on the floor lie flat and reach from the heel to the ball and over its breadth."""
    if len(places) < 3 or scatter > FLAT * standing.length:
        return False
    x, y = places @ standing.along, places @ np.cross(standing.up, standing.along)
    return bool(np.ptp(x) > SOLE_LENGTH * standing.length and np.ptp(y) > SOLE_BREADTH * standing.length)


def _resting(hull: ConvexHull, vertices: Floats, standing: _Standing) -> tuple[Floats, float]:
    """Returns the upward normal and the height of the face of the hull on which the foot comes to rest.

    It is the face under the middle of the foot's lower part.
    """
    up, height = standing.up, vertices @ standing.up
    middle = vertices[height <= height.min() + LOW * standing.length].mean(axis=0)
    normals, offsets = hull.equations[:, :3], hull.equations[:, 3]
    for _ in range(FLOOR_ROUNDS):
        down = -normals @ up
        distance = np.where(down > 1e-3, -(normals @ middle + offsets) / np.maximum(down, 1e-3), np.inf)
        face = int(np.argmin(distance))
        if np.allclose(-normals[face], up, atol=1e-12):
            break
        up = -normals[face]
    return up, float(offsets[face])


def _standing_transform(vertices: Floats, up: Floats, offset: float, standing: _Standing) -> Floats:
    """Returns (4, 4) the transform to a frame with X along the footprint towards the toes and Z up from the floor."""
    along = standing.along - (standing.along @ up) * up
    along /= np.linalg.norm(along)
    transform = np.eye(4)
    transform[:3, :3] = along, np.cross(up, along), up
    transform[:3, 3] = 0.0, 0.0, -offset
    transform[:2, 3] = -(transform[:2, :3] @ vertices.mean(axis=0))
    return transform


def _leg_end(
    vertices: Floats, candidates: list[tuple[Floats, float]], transform: Floats, length: float
) -> Floats | None:
    """Returns (N, 3) vertices of the flat face of the hull, looking up, in which a cut leg ends, with a lid or without.

    None if there is no such face.
    """
    up = transform[2, :3]
    for normal, area in candidates:
        if normal @ up > LID_FACING and area > LID_AREA * length**2:
            out = vertices @ normal
            end = vertices[out > out.max() - LID_FLAT * length]
            if (end @ up).min() + transform[2, 3] > LID_HEIGHT * length:
                return np.asarray(end)
    return None

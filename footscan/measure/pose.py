"""How a foot lies in space, whatever its pose and its unit: where its sole, its heel and its toes are.

A body rests on faces of its convex hull. Those of a foot are the sole, the cut through the leg, both sides and the
slope from the leg to the toes; of these the sole touches the floor with the largest area of skin.
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
"""Parts of the hull that are looked at; the largest ones may be the sole."""
COARSE, SAME_FACE_DEG = 8, 8.0
"""Faces of the hull that are so nearly parallel rest on one floor."""
FACING = 0.85
"""Skin faces the floor where its normal does, by this cosine."""
TOUCHING = 0.02
"""Skin so near to the floor touches it, in parts of the footprint's length: 5 mm on a foot of 260 mm."""
LOW = 0.24
"""Below this height, in parts of the footprint's length, there is foot and no leg."""
TOES = 0.85
SLENDER, UNLIKELY = 1.5, 0.05
"""A footprint is longer than broad by this; another face of the hull counts as little."""
FLAT = 0.004
"""A sole that scatters less about its floor stands on it, in parts of the length: 1 mm on 260 mm."""
SOLE_LENGTH, SOLE_BREADTH = 0.5, 0.2
"""It reaches so far along and across, in parts of the length."""
LEAST_REACH = 2e-4
"""0.05 mm on 260 mm"""
SCATTERS_WIDE = 4.0
"""Skin farther from the floor than so many standard deviations of what lies on it is off it."""
FLOOR_ROUNDS = 60
LID_FACING, LID_FLAT, LID_AREA, LID_HEIGHT = 0.6, 0.004, 0.012, 0.15
"""The end of a leg looks up by this cosine, is so flat in parts of the length, and so large in parts of its square (800
mm² on a foot of 260 mm), and lies above the toes."""


class Pose(NamedTuple):
    """A foot on its floor."""

    transform: Floats
    """(4, 4) from the mesh's frame: floor at Z = 0, Z up, X from heel to toes along the footprint; the unit is kept."""
    length: float
    """About the foot's length."""
    residual: float
    """Standard deviation of the skin on the floor about it."""
    stands: bool
    """Whether a sole lies on the floor; otherwise the foot touches it in some points only."""
    convexity: float
    """Volume over that of the convex hull: 1 of a ball, a block, an egg."""
    leg_end: Floats | None
    """(N, 3) the flat end of the leg, which was cut, in the mesh's frame; None where there is none."""


def find_pose(vertices: Floats, faces: NDArray[np.integer]) -> Pose:
    """The pose of a foot's mesh, (V, 3) and (F, 3), that may lie any way round and be in any unit.

    Faces look all outward or all inward. Left and right feet are treated alike.

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
    downs = [normal for normal, _ in candidates[:LARGEST]]
    best = max((_standing(vertices, skin, -down) for down in downs), key=lambda standing: standing.score)
    up, offset, residual, stands = _floor(vertices, skin, hull, best)
    transform = _standing_transform(vertices, up, offset, best)
    end = _leg_end(vertices, candidates, transform, best.length)
    return Pose(transform, best.length, residual, stands, abs(inside) / float(hull.volume), end)


def volume(vertices: Floats, faces: NDArray[np.integer]) -> float:
    """Of a closed mesh, below 0 where its faces look inwards; of an open one about what it encloses."""
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
    """(V,) a third of the triangles around each vertex"""
    rims: Floats
    """(E, 2, 3) open edges, the surface on their left"""


def _skin(vertices: Floats, faces: NDArray[np.integer]) -> _Skin:
    return _Skin(*vertex_normals_and_areas(vertices, faces), _rims(vertices, faces))


def _rims(vertices: Floats, faces: NDArray[np.integer]) -> Floats:
    corners = np.ascontiguousarray(faces, np.int64)
    alone, slot = np.nonzero(face_neighbours(corners, len(vertices)) < 0)
    return np.stack([vertices[corners[alone, slot]], vertices[corners[alone, (slot + 1) % 3]]], axis=1)


def _open_area(rims: Floats, up: Floats, reach: float) -> float:
    """Area of the openings that the floor closes: where a scanner could not see the sole."""
    if not len(rims):
        return 0.0
    height = rims @ up
    on_floor = rims[(height < height.min() + reach).all(axis=1)]
    if not len(on_floor):
        return 0.0
    on_floor = on_floor - on_floor.mean(axis=(0, 1))
    return max(float(np.cross(on_floor[:, 0], on_floor[:, 1]).sum(axis=0) @ up) / 2, 0.0)


def _hull_faces(vertices: Floats, hull: ConvexHull) -> list[tuple[Floats, float]]:
    """Outward normals of the largest nearly flat parts of the hull, and their areas."""
    corners = vertices[hull.simplices]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.sqrt(np.einsum("ni,ni->n", crosses, crosses)) / 2
    normals = hull.equations[:, :3]
    # A flat part is cut into many triangles: those of about one direction count together.
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
    """Unit vectors, the latter along the footprint."""
    length: float


def _standing(vertices: Floats, skin: _Skin, up: Floats) -> _Standing:
    """How well a foot would stand with `up` upwards: by the skin that touches the floor, and by its form."""
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
    """(3, 2) unit vectors at right angles to `up` and to each other, as they make a right-handed frame with it."""
    first = np.cross(np.eye(3)[np.argmin(np.abs(up))], up)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(up, first)])


@compiled
def _spread(points: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """(D,) mean and (D, D) covariance of (N, D) points by their (N,) weights, which are not all 0."""
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
    """Upward normal, height of the floor along it, scatter of the skin on it, and whether a sole lies there.

    A plane is fitted to the skin that faces down, nearer and nearer to it: the rounded edge of a sole and its arch drop
    out. Where what remains is no area as large as a sole, the floor is the face of the hull that the foot rests on.
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
    """Whether the points on the floor lie flat and reach from the heel to the ball and over its breadth."""
    if len(places) < 3 or scatter > FLAT * standing.length:
        return False
    x, y = places @ standing.along, places @ np.cross(standing.up, standing.along)
    return bool(np.ptp(x) > SOLE_LENGTH * standing.length and np.ptp(y) > SOLE_BREADTH * standing.length)


def _resting(hull: ConvexHull, vertices: Floats, standing: _Standing) -> tuple[Floats, float]:
    """The face of the hull on which the foot comes to rest: under the middle of its lower part."""
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
    """X along the footprint towards the toes, Z up from the floor."""
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
    """A leg that was cut ends in a flat face of the hull that looks up, whether it is closed by a lid or open."""
    up = transform[2, :3]
    for normal, area in candidates:
        if normal @ up > LID_FACING and area > LID_AREA * length**2:
            out = vertices @ normal
            end = vertices[out > out.max() - LID_FLAT * length]
            if (end @ up).min() + transform[2, 3] > LID_HEIGHT * length:
                return np.asarray(end)
    return None

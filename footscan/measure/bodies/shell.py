"""Shells: the sole of a foot with a rim, without its upper side, as scanners that look from below see it.

How far the foot reaches beyond the rim is unknown. Where the skin still leans outwards at the rim, it may go on so.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, KDTree, QhullError

from footscan.measure.bodies.sole import close_sole, flat_lid, holes, opening_area
from footscan.measure.frame.pose import Pose, find_pose, volume
from footscan.mesh.rigid_transform import apply
from footscan.mesh.topology import used_vertices, vertex_normals

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]

LOW = 0.16
"""A shell is lower than this share of its length: 42 mm on a foot of 262 mm. Feet that are cut higher are recognised by
their instep, which is higher than the toes. Chosen by hand."""
OPEN_SHARE = 0.1
"""The opening of a shell has more than this share of the squared length as area; outlines of feet have 0.25 to 0.35.
Chosen by hand."""
LIDS = 4
"""Number of triangles of the hull in whose plane a lid is sought, the largest first; chosen by hand."""
REAR, FRONT = (0.08, 0.22), (0.78, 0.92)
"""Shares of the length near both ends, of which the heel's is narrower; chosen by hand."""
LEAST_RISE = 0.5
"""Skin that goes on beyond the rim rises by at least this share of its way: outlines grow by less than 1.8 times the
height that is missing. Chosen by hand."""
LEAN_MM = 4.0
"""How skin leans at the rim is the mean of the skin that is nearer than this. Chosen by hand."""
RINGS = 5
"""Rings of triangles beyond the rim: about 2 mm each."""

UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


class Shell(NamedTuple):
    """A foot without its upper side."""

    vertices: Floats
    """(V, 3)"""
    faces: Faces
    """(F, 3), without a lid"""
    pose: Pose


def find_shell(vertices: Floats, faces: Faces) -> Shell | None:
    """Take a mesh as a shell, open or under a flat lid; None if it is something else.

    Parameters
    ----------
    vertices : (V, 3), any frame and unit
    faces : (F, 3), looking outward
    """
    for shape in _without_lids(vertices, faces):
        if (pose := _opened(*shape)) is not None:
            return Shell(*shape, pose)
    return None


def continued(vertices: Floats, faces: Faces, up: Floats, height: float) -> tuple[Floats, Faces]:
    """Returns the vertices and faces of a shell whose skin goes on beyond its rim as it leans there.

    Parameters
    ----------
    vertices : (V, 3) mm
    up : (3,) unit vector
    height : of the new rim above the old one, mm
    """
    rim = _rim(vertices, faces)
    ends, number = np.unique(rim, return_inverse=True)
    all_normals = vertex_normals(vertices, faces)
    near = KDTree(vertices).query_ball_point(vertices[ends], LEAN_MM)
    normals = np.array([all_normals[around].mean(axis=0) for around in near])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    along = up - (normals @ up)[:, None] * normals
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    away = along / np.maximum(along @ up, LEAST_RISE)[:, None]
    added = [vertices, *(vertices[ends] + height * share * away for share in np.arange(1, RINGS + 1) / RINGS)]
    skirt = [faces]
    first, second = rim.T
    for ring in range(RINGS):
        above, above_second = (number.reshape(rim.shape) + len(vertices) + ring * len(ends)).T
        # The rim runs with the skin on its left, so that the new skin runs against it.
        skirt += [np.column_stack(face) for face in ((second, first, above), (second, above, above_second))]
        first, second = above, above_second
    return np.concatenate(added), np.concatenate(skirt).astype(np.int32)


def _without_lids(vertices: Floats, faces: Faces) -> Iterator[tuple[Floats, Faces]]:
    """Yield the mesh as it is, then without the flat lid that it may have."""
    yield vertices, faces
    try:
        hull = ConvexHull(vertices)
    except (QhullError, ValueError):
        return
    length = float(np.ptp(vertices, axis=0).max())
    corners = vertices[hull.simplices]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    for largest in np.argsort(-areas)[:LIDS]:
        lid = flat_lid(vertices, faces, length, hull.equations[largest, :3])
        if lid.any():
            yield used_vertices(vertices, faces[~lid])
            return


def _opened(vertices: Floats, faces: Faces) -> Pose | None:
    """The pose of an open shell; None if the mesh is none."""
    rim = _rim(vertices, faces)
    into_body = opening_area(vertices[rim])
    area = float(np.linalg.norm(into_body))
    if not area > 0:
        return None
    pose = find_pose(vertices, faces, up=-into_body / area)
    places = apply(pose.transform, vertices)
    if area < OPEN_SHARE * pose.length**2 or np.ptp(places[:, 2]) > LOW * pose.length:
        return None
    closed = close_sole(apply(UPSIDE_DOWN, places), faces, pose.length)
    if closed is None:
        return None
    convexity = abs(volume(closed.vertices, closed.faces)) / float(ConvexHull(closed.vertices).volume)
    turn = np.diag([-1.0, -1.0, 1.0, 1.0] if _runs_backwards(places) else np.ones(4))
    return pose._replace(transform=turn @ pose.transform, convexity=convexity)


def _runs_backwards(places: Floats) -> bool:
    """True if the broader end, the ball, lies at the lower X."""
    x, y = places[:, 0] - places[:, 0].min(), places[:, 1]
    share = x / x.max()
    rear, front = (np.ptp(y[(share > first) & (share < last)]) for first, last in (REAR, FRONT))
    return bool(rear > front)


def _rim(vertices: Floats, faces: Faces) -> NDArray[np.int64]:
    """Returns (E, 2) the edges of the largest hole; none without one."""
    found = holes(faces, len(vertices))
    return max(found, key=len) if found else np.zeros((0, 2), np.int64)

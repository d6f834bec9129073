"""Preparation of meshes from other scanners: unit, stray parts, orientation, and whether heel and toes are whole."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, KDTree, QhullError

from footscan.measure.bodies.ends import Part, missing_ends
from footscan.measure.bodies.floor import floor_faces
from footscan.measure.bodies.shell import find_shell
from footscan.measure.bodies.sole import close_sole
from footscan.measure.frame.foot_frame import CONVEX
from footscan.measure.frame.pose import Pose, find_pose, volume
from footscan.mesh.rigid_transform import apply
from footscan.mesh.topology import directed_edges, face_components, used_vertices
from footscan.rows import distinct_rows
from schemas.base.errors import Finding

Floats = NDArray[np.float64]
Faces = NDArray[np.int32]
MeshUnit = Literal["mm", "cm", "m", "in"]

MILLIMETRES: dict[MeshUnit, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
FOOT_MM = (115.0, 335.0), (100.0, 380.0)
"""Ranges of foot length from which the unit is inferred: first from a child of one year to the largest size in common
use, then the extremes."""
LEAST_FACES = 40
"""A mesh with fewer triangles is refused; chosen by hand."""
STRAY_SHARE = 0.02
"""Parts with less than this share of the triangles are strays; chosen by hand."""
FOOT_SHARE = 0.3
"""Each of two feet has at least this share of the triangles of the other; chosen by hand."""
BODY_SHARE = 0.5
"""Parts of more than this share of the largest part's extent may be a second body; chosen by hand."""
HULL_SAMPLES, APART = 200, 0.2
"""A part is a second body if less than the share APART of about so many of its points lies within the hull of the
first; layers of one surface lie within the same hull. Chosen by hand."""
LID_REACH = 1e-6
"""Vertices nearer than this share of the length to a point of the leg's end are that point."""
OPEN_EDGES = 0.001
"""A surface with a greater share of open edges is reported as open; with a smaller one, as having small holes.
Chosen by hand."""
COARSE_MM = 0.02
"""A larger rounding of coordinates by single precision is reported; chosen by hand."""


class RawMesh(NamedTuple):
    """A mesh in mm that may be a foot, its triangles looking outward, with a record of the changes."""

    vertices: Floats
    """(V, 3) mm"""
    faces: Faces
    """(F, 3), counter-clockwise as seen from outside"""
    unit: MeshUnit
    """Unit of the input"""
    factor: float
    """Factor from that unit to mm"""
    is_closed: bool
    notes: tuple[str, ...]
    """Remarks for the user, each a sentence without a full stop"""
    missing: tuple[Part, ...] = ()
    """Ends of the foot that are cut off, open or not there"""
    closing: NDArray[np.bool_] | None = None
    """(V,) vertices on the floor that close a sole which was not seen; None if the sole was seen"""
    lid: NDArray[np.bool_] | None = None
    """(V,) vertices of the flat end of the leg; None without one"""
    tilt_deg: float = 0.0
    """Standard deviation of the tilt of a floor that follows from the rim of an open sole"""
    to_floor: Floats = np.eye(4)
    """(4, 4) from the frame of the mesh to one with the floor at Z = 0"""
    shell: Pose | None = None
    """Pose of a shell, a foot without its upper side, in mm; None if the upper side was seen"""


def prepare_feet(
    vertices: NDArray[np.floating], faces: NDArray[np.integer], unit: MeshUnit | None = None
) -> list[RawMesh]:
    """Prepare a mesh that holds one foot or two, and maybe the floor; as `prepare_mesh`, whose foot is a single one.

    Raises
    ------
    Finding
        As of `prepare_mesh`; or the surface holds more than two bodies.
    """
    _check_finite(vertices)
    vertices, faces = _clean(np.asarray(vertices, np.float64), np.asarray(faces, np.int32))
    notes: list[str] = []
    plane = None
    found = floor_faces(vertices, np.where(_against(faces, _meetings(faces))[:, None], faces[:, ::-1], faces))
    if found is not None and np.count_nonzero(~found[0]) >= LEAST_FACES:
        floor, plane = found
        vertices, faces = used_vertices(vertices, faces[~floor])
        notes.append("a flat part under the foot, the floor, was left out")
    component = face_components(faces)
    counts = np.bincount(component)
    large = np.flatnonzero(counts >= FOOT_SHARE * counts.max())
    bodies = [used_vertices(vertices, faces[component == part]) for part in large]
    extents = [_extent(body) for body, _ in bodies]
    if len(bodies) == 2 and min(extents) > BODY_SHARE * max(extents) and _inside(bodies[1][0], bodies[0][0]) < APART:
        strays = len(counts) - 2
        notes += ["the surface holds two feet, which are measured as a pair"]
        notes += [f"{strays} small part{'s' if strays > 1 else ''} apart from the feet left out"] if strays else []
        return [_prepared(*body, unit, plane, notes) for body in bodies]
    return [_prepared(vertices, faces, unit, plane, notes)]


def prepare_mesh(vertices: NDArray[np.floating], faces: NDArray[np.integer], unit: MeshUnit | None = None) -> RawMesh:
    """Prepare the mesh of a single foot from elsewhere for `foot_frame`.

    Repeated vertices are merged, triangles without area and small stray parts are left out, triangles are turned to
    look outward, and the unit is inferred from the size of the foot unless it is stated. The pose is not changed.

    Parameters
    ----------
    vertices : (V, 3) in mm, cm, m or inches
    faces : (F, 3)
    unit : of the vertices; default: inferred

    Raises
    ------
    Finding
        The mesh has hardly any triangles, coordinates that are no numbers, or several bodies; its size is that of a
        foot in no unit or in two; or it has neither heel nor toes, or gaps at the ball.
    """
    _check_finite(vertices)
    vertices, faces = _clean(np.asarray(vertices, np.float64), np.asarray(faces, np.int32))
    return _prepared(vertices, faces, unit, None, [])


def _check_finite(vertices: NDArray[np.floating]) -> None:
    if not np.all(np.isfinite(vertices)):
        raise Finding("the surface has coordinates that are no numbers, expected a foot")


def _prepared(
    vertices: Floats, faces: Faces, unit: MeshUnit | None, floor: tuple[Floats, Floats] | None, before: list[str]
) -> RawMesh:
    """Prepare a foot; `floor` is a point and the upward normal of the floor, if that was seen."""
    notes = list(before)
    vertices, faces = _one_body(vertices, faces, notes)
    meetings = _meetings(faces)
    is_closed = _is_closed(meetings, notes)
    faces = _outward(vertices, faces, meetings, notes)
    shell = find_shell(vertices, faces)
    if shell is None:
        pose = find_pose(vertices, faces)
    else:
        vertices, faces, pose = shell
        notes.append("the upper side was not seen, only the sole with its rim")
    mesh_unit = _unit(pose.length, unit)
    missing: tuple[Part, ...] = ()
    if pose.convexity < CONVEX:  # foot_frame refuses a more convex body
        missing = missing_ends(apply(pose.transform, vertices) / pose.length, faces)
    notes += [f"the foot is cut off or open at the {part}" for part in missing]
    level = None if floor is None else float(apply(pose.transform, floor[0][None])[0, 2])
    sole = close_sole(apply(pose.transform, vertices), faces, pose.length, level) if shell is None else None
    if sole is not None:
        vertices, faces = apply(np.linalg.inv(pose.transform), sole.vertices), sole.faces
        notes.append("the sole was not seen and was closed flat at the floor")
    factor = MILLIMETRES[mesh_unit]
    if mesh_unit != "mm":
        origin = "as stated" if unit is not None else f"inferred from the length of {pose.length:.3g}"
        notes.append(f"coordinates in {mesh_unit}, {origin}, were multiplied by {factor:g} to obtain mm")
    _report_rounding(vertices, factor, notes)
    to_floor = pose.transform.copy()
    if sole is not None:
        to_floor[2, 3] -= sole.level
    to_floor[:3, 3] *= factor
    return RawMesh(
        vertices * factor,
        faces,
        mesh_unit,
        factor,
        is_closed,
        tuple(notes),
        missing,
        None if sole is None else sole.closing,
        _at(vertices, pose.leg_end, LID_REACH * pose.length),
        0.0 if sole is None else float(np.degrees(np.arctan(sole.uneven / (pose.length / 2)))),
        to_floor,
        None if shell is None else pose.scaled(factor),
    )


def _at(vertices: Floats, points: Floats | None, reach: float) -> NDArray[np.bool_] | None:
    """Returns (V,) which vertices lie at one of the points; None without points."""
    return None if points is None else np.asarray(KDTree(points).query(vertices)[0] < reach)


def _clean(vertices: Floats, faces: Faces) -> tuple[Floats, Faces]:
    """Merge repeated vertices and drop triangles without area."""
    if len(faces):
        if np.any(_meetings(faces).counts == 1):  # a closed surface repeats no vertices
            merged = distinct_rows(vertices)
            if len(merged.rows) < len(vertices):
                vertices, faces = merged.rows, merged.number[faces].astype(np.int32)
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        extent = float(np.linalg.norm(np.ptp(vertices, axis=0)))
        faces = faces[doubled > (1e-9 * extent) ** 2]
    if len(faces) < LEAST_FACES:
        raise Finding(f"the surface has {len(faces)} triangles, expected a foot of at least {LEAST_FACES}")
    return vertices, faces


def _one_body(vertices: Floats, faces: Faces, notes: list[str]) -> tuple[Floats, Faces]:
    """Drop stray parts; raises `Finding` if there is a second body."""
    component = face_components(faces)
    counts = np.bincount(component)
    large = np.flatnonzero(counts >= STRAY_SHARE * len(faces))
    bodies = [vertices[np.unique(faces[component == part])] for part in large]
    bodies.sort(key=lambda body: (_is_flat(body), -_extent(body)))
    first, others = bodies[0], [body for body in bodies[1:] if _extent(body) > BODY_SHARE * _extent(bodies[0])]
    apart = [body for body in others if _extent(body) > _extent(first) or _inside(body, first) < APART]
    if apart:
        raise Finding(f"the surface has {len(apart) + 1} separate bodies, expected a single foot")
    strays = len(counts) - len(large)
    if strays:
        notes.append(f"{strays} small part{'s' if strays > 1 else ''} apart from the foot left out")
    return used_vertices(vertices, faces[np.isin(component, large)])


def _extent(body: Floats) -> float:
    return float(np.linalg.norm(np.ptp(body, axis=0)))


def _is_flat(body: Floats) -> bool:
    """True for a flat part, such as a plate on which a foot stands."""
    spread = np.linalg.eigvalsh(np.cov(body.T))
    return bool(spread[0] < 1e-6 * spread[-1])


def _inside(points: Floats, body: Floats) -> float:
    """The share of `points` that lie within the convex hull of `body`; 1 where that is flat."""
    try:
        planes = ConvexHull(body).equations
    except QhullError:
        return 1.0
    tested = points[:: len(points) // HULL_SAMPLES + 1]
    return float(np.mean([np.all(planes[:, :3] @ point + planes[:, 3] <= 0) for point in tested]))


class _Meetings(NamedTuple):
    """Sides of faces, grouped by the edges at which they meet."""

    order: NDArray[np.intp]
    """(3F,) sides of faces, numbered as in `directed_edges`, sorted by edge"""
    first: NDArray[np.intp]
    """(E,) place in `order` where each edge begins"""
    counts: NDArray[np.intp]
    """(E,) number of faces of each edge"""


def _meetings(faces: Faces) -> _Meetings:
    edges = directed_edges(faces)
    key = edges.min(axis=1) * (int(faces.max()) + 1) + edges.max(axis=1)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    return _Meetings(order, first, np.diff(first, append=len(key)))


def _is_closed(meetings: _Meetings, notes: list[str]) -> bool:
    share = float(np.mean(meetings.counts == 1))
    if share == 0:
        return True
    notes.append(
        f"the surface is open at {share:.1%} of its edges" if share > OPEN_EDGES else "the surface has small holes"
    )
    return False


def _outward(vertices: Floats, faces: Faces, meetings: _Meetings, notes: list[str]) -> Faces:
    """Returns (F, 3) faces that all look outward."""
    against = _against(faces, meetings)
    if against.any():
        faces = np.where(against[:, None], faces[:, ::-1], faces)
        turned = np.count_nonzero(against)
        notes.append(f"{turned} triangles faced against their neighbours and were turned over")
    if volume(vertices, faces) < 0:
        faces = faces[:, ::-1].copy()
        notes.append("the surface faced inward and was turned over")
    return faces


def _against(faces: Faces, meetings: _Meetings) -> NDArray[np.bool_]:
    """Returns (F,) which faces look to the other side than most faces of the part that edges join them to.

    A graph holds each face twice, as it is and turned over. Two faces that run an edge in opposite directions look to
    the same side.
    """
    count = len(faces)
    pairs = meetings.first[meetings.counts == 2]
    first, second = meetings.order[pairs], meetings.order[pairs + 1]
    rises = np.diff(directed_edges(faces), axis=1)[:, 0] > 0
    turned = rises[first] == rises[second]
    if not turned.any():
        return np.zeros(count, np.bool_)
    first, second = first % count, second % count
    rows = np.concatenate([first, first + count])
    columns = np.concatenate([second + count * turned, second + count * ~turned])
    graph = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(2 * count, 2 * count))
    _, side = connected_components(graph, directed=False)
    as_is, over = side[:count], side[count:]
    alike = np.bincount(as_is, minlength=int(side.max()) + 1)
    against: NDArray[np.bool_] = (alike[as_is] < alike[over]) | ((alike[as_is] == alike[over]) & (as_is > over))
    return against


def _unit(length: float, stated: MeshUnit | None) -> MeshUnit:
    """The stated unit, or the only unit in which a foot has this length."""
    if stated is not None:
        if not FOOT_MM[1][0] <= MILLIMETRES[stated] * length <= FOOT_MM[1][1]:
            size = f"the surface is {length:.3g} long, which is {MILLIMETRES[stated] * length:.3g} mm if in {stated}"
            raise Finding(f"{size}, expected a foot of {FOOT_MM[1][0]:.0f} to {FOOT_MM[1][1]:.0f} mm")
        return stated
    for least, greatest in FOOT_MM:
        fitting = [unit for unit, factor in MILLIMETRES.items() if least <= factor * length <= greatest]
        if len(fitting) == 1:
            return fitting[0]
        if fitting:
            sizes = " or ".join(f"{MILLIMETRES[unit] * length:.0f} mm if in {unit}" for unit in fitting)
            raise Finding(f"the surface is {length:.3g} long, which is {sizes}; expected the unit to be stated")
    expected = f"expected a foot of {least:.0f} to {greatest:.0f} mm in one of {', '.join(MILLIMETRES)}"
    raise Finding(f"the surface is {length:.3g} long, {expected}")


def _report_rounding(vertices: Floats, factor: float, notes: list[str]) -> None:
    """Add a note where coordinates lie so far from the origin that single precision is coarse."""
    step = float(np.abs(vertices).max()) * 2.0**-24 * factor
    if step > COARSE_MM and np.array_equal(vertices, vertices.astype(np.float32)):
        notes.append(f"the surface lies so far from the origin that its coordinates are rounded by up to {step:.2g} mm")

"""A cuboid fitted to a cloud: dimensions, angles and flatness, which show the accuracy of the scanner."""

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from footscan.mesh.cells import cell_means, group_by_cell
from footscan.verify.shapes.box_refinement import Box, Face, FacePoints, refine_box
from footscan.verify.shapes.box_search import rough_box
from footscan.verify.shapes.fitting import Floats, as_vector, distinct_points
from footscan.verify.shapes.stripe_ends import (
    Beside,
    End,
    Sights,
    end_between_stripes,
    known_end,
    length_between,
    stripe_planes,
)
from schemas.base.errors import Finding
from schemas.fits import Basis, CuboidDimension, CuboidFit, CuboidParameters, FaceAngle, FaceFit, FaceName

NAMES: tuple[tuple[FaceName, FaceName], ...] = (("back", "front"), ("right", "left"), ("bottom", "top"))
"""Lower and upper face of each axis: X, Y and Z"""
LEAST_POINTS = 100
"""Least number of distinct points; chosen by hand."""
LEAST_SHARE = 0.6
"""Least share of the points on the faces or near their edges; chosen by hand."""
MOST_UNEVEN_MM = 1.5
"""Largest robust standard deviation of the points of a flat face; chosen by hand."""
CELL_MM = 10.0
"""Edge of the cells of a face whose scatter gives its uncertainty, since points of few stripes share their errors.
Chosen by hand."""
LEAST_IN_CELL = 5
"""Least number of points of such a cell; chosen by hand."""
LEAST_CELLS = 4
"""Least number of such cells; chosen by hand."""
NARROW_MM = 2.0
"""Points of a face with a smaller standard deviation are a line and give no plane; chosen by hand."""
STANDING_DEGREES = 2.0
"""A cuboid that leans more does not stand on the floor; chosen by hand."""
ACROSS = np.cos(np.radians(45))
"""Least cosine between the travel and an axis whose ends are located by stripes"""
BESIDE_MM = 1.0
"""Largest distance from the adjacent faces of points of an end's last stripes, since cut stripes are displaced.
Chosen by hand."""


@dataclass(frozen=True)
class _Plane:
    """The plane of one face, fitted independently of the others."""

    centre: Floats
    normal: Floats
    """(3,) unit vector, outward."""


@dataclass(frozen=True)
class _End:
    """An end of the cuboid along one of its axes, with the evidence for it."""

    basis: Basis
    stands: End


def fit_cuboid(points: Floats, parameters: CuboidParameters | None = None, sights: Sights | None = None) -> CuboidFit:
    """Fit a cuboid to `points`: its faces, dimensions and angles.

    The points are assigned to faces automatically (see `box_search`). Planes at right angles are fitted to all faces
    together by least squares, without edges and without outliers beyond four robust standard deviations. In addition, a
    plane is fitted to each face alone by total least squares. `CuboidDimension.ends` names the evidence for the place
    of each face, including faces that were not seen.

    Parameters
    ----------
    points : (N, 3) float64, mm, scanner frame; in any order, of a cloud or spread over a mesh
    parameters : width of an edge, height of the floor and thickness of the laser sheet
    sights : the points of each camera, which locate an end between stripes more precisely

    Raises
    ------
    Finding
        The points are no numbers, too few, in one plane, or of a body that is no cuboid.
    """
    parameters = parameters or CuboidParameters()
    points = distinct_points(points)
    if len(points) < LEAST_POINTS:
        raise Finding(f"{len(points)} distinct points, expected at least {LEAST_POINTS} on a cuboid")
    box = refine_box(points, *rough_box(points), parameters.edge_mm)
    on_body = _check_cuboid(points, box)
    planes = stripe_planes(points[on_body, 0])

    own = {of_face.face: plane for of_face in box.faces if (plane := _own_plane(points, box, of_face))}
    faces = {of_face.face: _face_fit(points, box, of_face, own.get(of_face.face)) for of_face in box.faces}
    seen = sights or Sights(points, np.zeros(len(points), np.intp), {})
    ends = {face: _end(points, box, face, faces, planes, seen, parameters) for face in product(range(3), range(2))}
    along, across, up = (_dimension(box, axis, ends, own) for axis in range(3))
    return CuboidFit(
        axes=(as_vector(box.axes[0]), as_vector(box.axes[1]), as_vector(box.axes[2])),
        dimensions=(along, across, up),
        faces=list(faces.values()),
        angles=[_angle(a, b, own[a], own[b]) for a, b in combinations(own, 2)],
        points=len(points),
        off_points=len(points) - int(np.count_nonzero(on_body)),
        edge_mm=parameters.edge_mm,
        floor_mm=parameters.floor_mm,
        stripe_step_mm=float(np.median(np.diff(planes))) if len(planes) else None,
    )


def _check_cuboid(points: Floats, box: Box) -> NDArray[np.bool_]:
    """Returns (N,) which points lie on the faces or near their edges; raises `Finding` if there is no cuboid."""
    seen_axes = {of_face.face[0] for of_face in box.faces}
    if len(seen_axes) < 2:
        raise Finding("the points lie on no two faces at a right angle, expected a cuboid")
    on_body = np.zeros(len(points), np.bool_)
    for of_face in box.faces:
        on_body[of_face.kept] = on_body[of_face.near_edge] = True
    share = float(on_body.mean())
    if share < LEAST_SHARE:
        raise Finding(f"{share:.0%} of the points lie on the faces of a cuboid, expected at least {LEAST_SHARE:.0%}")
    worst = max(box.faces, key=lambda of_face: of_face.sigma_mm)
    if worst.sigma_mm > MOST_UNEVEN_MM:
        problem = f"is uneven by {worst.sigma_mm:.1f} mm, expected a cuboid with flat faces"
        raise Finding(f"the {_name(worst.face)} {problem}")
    return on_body


def _own_plane(points: Floats, box: Box, of_face: FacePoints) -> _Plane | None:
    """Fit a plane to the points of a face by total least squares; None if the points are a line."""
    centre = points[of_face.kept].mean(axis=0)
    centred = points[of_face.kept] - centre
    variance, vectors = np.linalg.eigh(centred.T @ centred / len(centred))
    normal = vectors[:, 0] * np.copysign(1.0, vectors[:, 0] @ _outward(box, of_face.face))
    return _Plane(centre, normal) if variance[1] > NARROW_MM**2 else None


def _face_fit(points: Floats, box: Box, of_face: FacePoints, own: _Plane | None) -> FaceFit:
    kept = points[of_face.kept]
    plane = own or _Plane(kept.mean(axis=0), _outward(box, of_face.face))
    residuals = (kept - plane.centre) @ plane.normal
    off_face = kept @ box.axes[of_face.face[0]] - box.limits[of_face.face]
    return FaceFit(
        name=_name(of_face.face),
        normal=as_vector(plane.normal),
        points=len(kept),
        edge_points=len(of_face.near_edge),
        outliers=of_face.outliers,
        rms_mm=float(np.sqrt(np.mean(residuals**2))),
        max_mm=float(np.abs(residuals).max()),
        uncertainty_mm=_scatter_of_cells(kept @ box.axes.T, of_face.face[0], off_face),
    )


def _scatter_of_cells(along: Floats, axis: int, off_face: Floats) -> float:
    """Standard uncertainty of the mean of (N,) distances `off_face`, from the scatter of 10 mm cells of the face."""
    order, starts = group_by_cell(np.delete(along, axis, axis=1), np.full(2, CELL_MM))
    counts = np.diff(np.append(starts, len(order)))
    means = cell_means(off_face[:, None], order, starts, np.ones(len(off_face)))[counts >= LEAST_IN_CELL, 0]
    if len(means) < LEAST_CELLS:
        return float(np.std(off_face))
    return float(np.std(means, ddof=1) / np.sqrt(len(means)))


def _end(
    points: Floats,
    box: Box,
    face: Face,
    faces: dict[Face, FaceFit],
    planes: Floats,
    sights: Sights,
    parameters: CuboidParameters,
) -> _End | None:
    """Locate the end of the cuboid towards `face`; None if there is no evidence of it."""
    axis, side = face
    if face in faces:
        place = float(box.limits[face])
        return _End("faces", known_end(place if side else -place, faces[face].uncertainty_mm))
    if face == (2, 0) and (2, 1) in faces and box.axes[2, 2] >= np.cos(np.radians(STANDING_DEGREES)):
        [top] = [of_face.kept for of_face in box.faces if of_face.face == (2, 1)]
        height = float(np.mean(points[top, 2])) - parameters.floor_mm
        return _End("floor", known_end(height - float(box.limits[2, 1]), 0.0))
    if axis != 2 and len(planes) and abs(box.axes[axis, 0]) >= ACROSS:
        beside, crossing_mm = _beside(box, face, sights)
        cosine = float(_outward(box, face)[0])
        return _End("stripes", end_between_stripes(beside, planes, cosine, crossing_mm, parameters.sheet_mm))
    return None


def _beside(box: Box, face: Face, sights: Sights) -> tuple[Beside, float]:
    """Returns the points on the faces adjacent to `face`, and the reach along the travel of its edges with them, mm."""
    axis, _ = face
    normal = _outward(box, face)
    along = sights.points @ box.axes.T
    centres = np.full((256, 3), np.nan)
    for camera, centre in sights.centres.items():
        centres[camera] = centre
    x, outward, off_faces, slopes, views, crossing = [], [], [], [], [], 0.0
    for number, of_face in enumerate(box.faces):
        beside, side = of_face.face
        if beside == axis:
            continue
        edge = 3 - axis - beside  # the axis along which the end meets this face
        off_face = (along[:, beside] - box.limits[of_face.face]) * (1 if side else -1)
        low, high = box.bounds[edge]
        near = (np.abs(off_face) <= BESIDE_MM) & (along[:, edge] >= low) & (along[:, edge] <= high)
        to_camera = centres[sights.camera[near]] - sights.points[near] * [0.0, 1.0, 1.0]
        x.append(sights.points[near, 0])
        outward.append(sights.points[near] @ normal)
        off_faces.append(off_face[near])
        slopes.append(np.sign(normal[0]) * (to_camera @ _outward(box, of_face.face)) / to_camera[:, 0])
        views.append(256 * number + sights.camera[near].astype(np.intp))
        crossing = max(crossing, abs(float(box.axes[edge, 0])) * float(high - low))
    return Beside(*map(np.concatenate, (x, outward, off_faces, slopes, views))), crossing


def _dimension(box: Box, axis: int, ends: dict[Face, _End | None], own: dict[Face, _Plane]) -> CuboidDimension:
    lower, upper = ends[axis, 0], ends[axis, 1]
    planes = [own[face] for face in ((axis, 0), (axis, 1)) if face in own]
    value, uncertainty = length_between(lower.stands, upper.stands) if lower and upper else (None, None)
    unknown = " and ".join(_name((axis, side)) for side in range(2) if ends[axis, side] is None)
    return CuboidDimension(
        axis=as_vector(box.axes[axis]),
        value_mm=value,
        uncertainty_mm=uncertainty,
        free_mm=_distance(*planes) if len(planes) == 2 else None,
        ends=(lower.basis if lower else None, upper.basis if upper else None),
        note=f"the place of its {unknown} is unknown" if unknown else None,
    )


def _distance(a: _Plane, b: _Plane) -> float:
    """Mean of the distances of each plane's centre to the other plane."""
    between = b.centre - a.centre
    return float((abs(between @ a.normal) + abs(between @ b.normal)) / 2)


def _angle(a: Face, b: Face, plane_a: _Plane, plane_b: _Plane) -> FaceAngle:
    turn = np.arctan2(np.linalg.norm(np.cross(plane_a.normal, plane_b.normal)), plane_a.normal @ plane_b.normal)
    return FaceAngle(faces=(_name(a), _name(b)), degrees=180 - float(np.degrees(turn)))


def _outward(box: Box, face: Face) -> Floats:
    axis: Floats = box.axes[face[0]]
    return axis if face[1] else -axis


def _name(face: Face) -> FaceName:
    return NAMES[face[0]][face[1]]

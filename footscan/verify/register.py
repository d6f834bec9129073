"""Registration: the rigid transform that brings one shape onto another, from any start."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from footscan.mesh.cells import group_by_cell
from footscan.mesh.formats.files import Shape
from footscan.mesh.sampling import sample_surface, surface_area
from footscan.verify.ambiguity import evidence, patches_of, stiffness
from footscan.verify.coarse import candidates, distinct, sketch, start_poses
from footscan.verify.icp import SETTLED_MM, Poses, capped_squares, fit_of, settle
from footscan.verify.nearest import CloudSurface, Floats, MeshSurface, Surface
from schemas.base.errors import Finding
from schemas.base.model import Document
from schemas.parameters.registration import RegistrationParameters

DEFAULTS = RegistrationParameters()
FEWEST_POINTS = 100
"""Least number of distinct points of a cloud; chosen by hand."""
FARTHEST_MM = 1e6
"""Largest coordinate that is accepted."""
THINNEST_MM = 1e-3
"""Least standard deviation along the shortest axis of a shape."""
FLAT = 0.02
"""A shape is flat if its standard deviation along the shortest axis is less than this share of that along the longest.
Chosen by hand."""
LARGEST_RATIO = 10.0
"""Largest ratio of the sizes of two shapes; a larger one comes from other units or from a fragment. Chosen by hand."""
FINEST_CELLS = 500
"""Cells along the diagonal of a cloud; points in one cell are merged. Chosen by hand."""
CLOUD_POINTS = 40_000
"""Bound of time: points that represent the surface of a cloud."""
CONTENDERS = 6
"""Bound of time: candidates that are refined against the surface itself."""
CONTENDER_POINTS = 1000
"""Bound of time: points of that refinement."""
CONTENDER_STEPS = 40
"""Bound of time: steps of that refinement."""
MOST_STEPS = 300
"""Bound of time: steps of the best candidate, with all points."""
WIDENED = 1.5
"""Factor of Tukey's scale from the refinement with few points to that with all; chosen by hand."""
FIRST_SCALE = 0.04
"""Tukey's scale at the start of the refinement, as a share of the size of the shape; chosen by hand."""
SAME_POSE = 0.01
"""Refined poses are the same if no point of the shape differs by more than this share of its size; chosen by hand."""
CAPPED = 0.03
"""Distances are capped at this share of the size of the shape: farther points have no counterpart. Chosen by hand."""
SOFTEST = 0.01
"""Least stiffness of a certain pose: feet and their parts have 0.02 or more, a cylinder of 16 sides or more less than
0.001."""
CERTAIN = 3.0
"""Standard deviations by which the runner-up must be worse; chosen by hand."""
TELLING_MM = 0.02
"""Poses whose rms residuals differ by less are equally good, however certain the difference is; chosen by hand."""
MATCHING_SHARE = 0.6
"""Least share of inliers among the overlapping points of two equal shapes; chosen by hand."""


class Residuals(Document):
    """Distances in mm of the points of one shape to the surface of the other, all points counted."""

    rms: float
    mean: float
    median: float
    inliers: float
    """Share of the points that lie no farther than `inlier_mm` from the other surface, not beyond its rim."""
    overlap: float
    """Share of the points that do not lie beyond the rim of the other surface. A closed one has none."""


class Registration(Document):
    """The rigid transform that brings a shape onto another, with the evidence for it."""

    transform: list[list[float]]
    """4 x 4, mm: the moving shape in the frame of the fixed one. Determinant +1: a left foot stays a left foot."""
    before: Residuals
    """Residuals in the frames of the input."""
    after: Residuals
    runner_up: Residuals | None
    """Residuals of the next best pose; None if all starts ended at one pose."""
    starts: int
    """Number of rotations that were tried."""
    agreeing: int
    """Number of starts that were refined to the end and ended at this pose."""
    stiffness: float
    """Mean square distance of the points from the surface after moving 1 mm in the least constrained direction."""
    verdict: Literal["same shape", "different shapes"]
    """The shapes differ if too few of the overlapping points are inliers; the pose is then merely the best one."""


@dataclass(frozen=True)
class _PreparedShape:
    """A shape in its own frame, with its mean at the origin and its principal axes along X, Y and Z."""

    points: Floats
    """(N, 3) mm, evenly spread, in random order"""
    surface: Surface
    to_own: Poses
    """One pose, from the frame of the input to this one"""
    size: float
    """Diagonal of the bounding box, mm"""


def register(moving: Shape, fixed: Shape, parameters: RegistrationParameters = DEFAULTS) -> Registration:
    """Compute the rigid transform that brings `moving`, a mesh or a cloud in mm, onto `fixed`, from any start.

    Many rotations between the principal axes of the two are refined by ICP on few points, and the better ones further.
    The best one is refined by robust point-to-plane ICP against the triangles until it moves by less than 0.0001 mm.
    Points whose nearest place is at the rim of the other surface, or beyond the scale of the residuals, have no weight,
    since either shape may be a part of the other. If only `fixed` is a cloud, its points are registered to the mesh,
    and the residuals are theirs. The result is the same at every call, for any number of threads.

    Raises
    ------
    Finding
        The pose is ambiguous, since a shape slides on the other or another pose is no worse; or a shape has too few
        points, is flat, has coordinates that are no numbers, or differs in size; or the registration does not settle.
    """
    source, target = _prepared(moving, "moving", parameters), _prepared(fixed, "fixed", parameters)
    if max(source.size, target.size) > LARGEST_RATIO * min(source.size, target.size):
        raise Finding(f"shapes of {source.size:.4g} mm and {target.size:.4g} mm, expected two of about one size")
    backward = isinstance(source.surface, MeshSurface) and isinstance(target.surface, CloudSurface)
    if backward:
        source, target = target, source
    poses, starts = candidates(sketch(source.points), sketch(target.points))
    contenders, scale, starts = _contenders(poses[:CONTENDERS], starts, source, target)
    if len(contenders) > 1:
        _refuse_equals(contenders[:1], contenders[1:2], source, target)
    best, scale, last_step = settle(contenders[:1], source.points, target.surface, WIDENED * scale, MOST_STEPS)
    least, direction = stiffness(best, source.points, target.surface, scale)
    if least < SOFTEST:
        raise Finding(f"ambiguous: {_slide(direction)}, stiffness {least:.2g}, expected at least {SOFTEST}")
    if not last_step < SETTLED_MM:
        raise Finding(f"the registration does not settle: its last step still moves the shape by {last_step:.3g} mm")
    after = _residuals(best, source, target, parameters)
    start = target.to_own.after(source.to_own.inverse())
    whole = target.to_own.inverse().after(best).after(source.to_own)
    return Registration(
        transform=_matrix(whole.inverse() if backward else whole).tolist(),
        before=_residuals(start, source, target, parameters),
        after=after,
        runner_up=_residuals(contenders[1:2], source, target, parameters) if len(contenders) > 1 else None,
        starts=len(start_poses()),
        agreeing=int(starts[0]),
        stiffness=least,
        verdict="same shape" if after.inliers >= MATCHING_SHARE * after.overlap else "different shapes",
    )


def _prepared(shape: Shape, name: str, parameters: RegistrationParameters) -> _PreparedShape:
    vertices, faces = np.asarray(shape[0], np.float64), np.asarray(shape[1])
    invalid = np.count_nonzero(~np.all(np.abs(vertices) <= FARTHEST_MM, axis=1))
    if invalid:
        raise Finding(f"{name}: {invalid} of {len(vertices)} points are no numbers or beyond {FARTHEST_MM:g} mm")
    is_mesh = len(faces) > 0 and surface_area(vertices, faces) > 0
    points = sample_surface(vertices, faces, parameters.points) if is_mesh else vertices
    if len(points) < FEWEST_POINTS:
        raise Finding(f"{name}: a cloud of {len(points)} points, expected at least {FEWEST_POINTS}, or a mesh")
    middle = points.mean(axis=0)
    offsets = points - middle
    variances, axes = np.linalg.eigh(np.einsum("ni,nj->ij", offsets, offsets) / len(points))
    short, _, long = np.sqrt(np.maximum(variances, 0.0))
    if short <= max(FLAT * long, THINNEST_MM):
        raise Finding(f"{name}: is flat, {short:.3g} mm thick and {long:.3g} mm long (standard deviations)")
    rotation = np.stack([axes[:, 2], axes[:, 1], np.cross(axes[:, 2], axes[:, 1])])
    to_own = Poses(rotation[None], -np.einsum("ij,j->i", rotation, middle)[None])
    own = to_own.place(points)[0]
    size = float(np.linalg.norm(np.ptp(own, axis=0)))
    if is_mesh:
        surface: Surface = MeshSurface((to_own.place(vertices)[0], faces))
    else:
        dense, own = _thinned(own, size, CLOUD_POINTS), _thinned(own, size, parameters.points)
        if len(own) < FEWEST_POINTS:
            raise Finding(f"{name}: {len(own)} of {len(points)} points are distinct, expected at least {FEWEST_POINTS}")
        surface = CloudSurface(dense)
    return _PreparedShape(own[np.random.default_rng(0).permutation(len(own))], surface, to_own, size)


def _thinned(points: Floats, size: float, count: int) -> Floats:
    """Select at most `count` evenly spread `points`, which lie around the origin: the first in each cell of a grid.

    A cell is centred at the origin, so that reversing an axis changes nothing. Repeated points are merged.
    """
    cell = size / FINEST_CELLS
    while True:
        order, starts = group_by_cell(points + cell / 2, np.full(3, cell))
        if len(starts) <= count:
            return points[np.sort(order[starts])]
        cell *= max(1.02, np.sqrt(len(starts) / count))


def _contenders(
    poses: Poses, starts: NDArray[np.intp], source: _PreparedShape, target: _PreparedShape
) -> tuple[Poses, float, NDArray[np.intp]]:
    """Refine candidates on few points against the surface itself.

    Returns the distinct poses, the best first, Tukey's scale of the best in mm, and the number of starts of each.
    """
    few, scale = source.points[:CONTENDER_POINTS], FIRST_SCALE * target.size
    settled = [settle(poses[k : k + 1], few, target.surface, scale, CONTENDER_STEPS) for k in range(len(poses))]
    best_first = np.argsort([_squares(pose, source, target, CONTENDER_POINTS).mean() for pose, _, _ in settled])
    rotations = np.concatenate([pose.rotations for pose, _, _ in settled])[best_first]
    translations = np.concatenate([pose.translations for pose, _, _ in settled])[best_first]
    contenders, starts = distinct(
        Poses(rotations, translations), starts[best_first], source.points, SAME_POSE * target.size
    )
    return contenders, settled[best_first[0]][1], starts


def _squares(pose: Poses, source: _PreparedShape, target: _PreparedShape, points: int | None) -> Floats:
    """Capped squared distances in both directions, since a part fits into a whole, but not the whole into it."""
    cap = CAPPED * target.size
    there = capped_squares(pose, source.points[:points], target.surface, cap)[0]
    back = capped_squares(pose.inverse(), target.points[:points], source.surface, cap)[0]
    return np.concatenate([there, back])


def _refuse_equals(best: Poses, other: Poses, source: _PreparedShape, target: _PreparedShape) -> None:
    squares, others = _squares(best, source, target, None), _squares(other, source, target, None)
    here, there = patches_of(source.points), patches_of(target.points)
    certainty = evidence(squares, others, np.concatenate([here, here.max() + 1 + there]))
    rms, other_rms = np.sqrt(squares.mean()), np.sqrt(others.mean())
    if certainty < CERTAIN or other_rms - rms < TELLING_MM:
        turn = Rotation.from_matrix(other.after(best.inverse()).rotations[0]).magnitude()
        raise Finding(
            f"ambiguous: a pose turned by {np.degrees(turn):.1f} degrees is as good, rms {other_rms:.3f} mm against "
            f"{rms:.3f} mm ({certainty:.1f} standard deviations better, expected at least {CERTAIN:g})"
        )


def _slide(direction: Floats) -> str:
    turn, shift = np.linalg.norm(direction[:3]), np.linalg.norm(direction[3:])
    return "the shape turns on itself" if turn > shift else "the shape slides along itself"


def _residuals(
    pose: Poses, source: _PreparedShape, target: _PreparedShape, parameters: RegistrationParameters
) -> Residuals:
    fit = fit_of(pose, source.points, target.surface)
    return Residuals(
        rms=float(np.sqrt(np.mean(fit.distances**2))),
        mean=float(fit.distances.mean()),
        median=float(np.median(fit.distances)),
        inliers=float(np.mean(fit.within & (fit.distances <= parameters.inlier_mm))),
        overlap=float(fit.within.mean()),
    )


def _matrix(pose: Poses) -> Floats:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotations[0], pose.translations[0]
    return matrix

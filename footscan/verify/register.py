"""Brings one shape onto another, from any start."""

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
"""Distinct points of a cloud."""
FARTHEST_MM = 1e6
THINNEST_MM = 1e-3
FLAT = 0.02
"""Standard deviation along the shortest axis over that along the longest, below which a shape is flat."""
LARGEST_RATIO = 10.0
"""Of the sizes of two shapes: metres beside millimetres, or a crumb."""
FINEST_CELLS = 500
"""Along the diagonal of a cloud: points that are nearer to one another become one."""
CLOUD_POINTS = 40_000
"""At most, that stand for the surface of a cloud."""
CONTENDERS = 6
"""Candidates that are held against the surface itself."""
CONTENDER_POINTS = 1000
CONTENDER_STEPS = 40
MOST_STEPS = 300
"""Of the best, with all points."""
WIDENED = 1.5
"""Tukey's scale that the best goes on with, of that which it had with few points."""
FIRST_SCALE = 0.04
"""Of the size of the shape: Tukey's scale at the start of the refinement."""
SAME_POSE = 0.01
"""Of the size of the shape: refined poses that place its points no farther apart are one."""
CAPPED = 0.03
"""Of the size of the shape: a distance that says no more than that there is nothing near."""
SOFTEST = 0.01
"""Stiffness below which a shape slides on the other: feet and parts of them have 0.02 and more, a cylinder
of 16 sides or more less than 0.001."""
CERTAIN = 3.0
"""Standard deviations by which the runner-up must be worse."""
TELLING_MM = 0.02
"""Difference of the rms residuals below which poses are equally good, however certain it is."""
MATCHING_SHARE = 0.6
"""Of inliers among the points that overlap, from which on the two are taken for the same shape."""


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
    """The one rigid motion that brings a shape onto another, and how much there is to be said for it."""

    transform: list[list[float]]
    """4 x 4, mm: the moving shape in the frame of the fixed one. Determinant +1: a left foot stays a left foot."""
    before: Residuals
    """In the frames that were given."""
    after: Residuals
    runner_up: Residuals | None
    """Of the next best pose; None where all starts ended at one."""
    starts: int
    """Rotations that were tried."""
    agreeing: int
    """Starts that were followed to the end and ended at this pose."""
    stiffness: float
    """Mean square by which points leave the surface for a movement of 1 mm in the direction that is held least."""
    verdict: Literal["same shape", "different shapes"]
    """Different shapes are where too few of the points that overlap are inliers: the pose is the best one, no more."""


@dataclass(frozen=True)
class _Side:
    """A shape about its own middle and along its own axes."""

    points: Floats
    """(N, 3) mm, evenly spread, in random order."""
    surface: Surface
    to_own: Poses
    """One pose: from the frame that was given."""
    size: float
    """mm, diagonal of the box."""


def register(moving: Shape, fixed: Shape, parameters: RegistrationParameters = DEFAULTS) -> Registration:
    """The rigid motion that brings `moving`, a mesh or a cloud, onto `fixed`, from any start.

    Many rotations between the principal axes of the two are refined by ICP on few points, the better ones further and
    further; the best by robust point-to-plane ICP against the triangles until it moves by less than 0.0001 mm. Points
    whose nearest place is at the rim of the other surface, or beyond the scale of the residuals, have no weight: either
    may be a part of the other. Where only `fixed` is a cloud, its points are held against the mesh, and the residuals
    are theirs. The same at every call, whatever the number of threads.

    Raises
    ------
    Finding
        The pose is ambiguous: a shape slides on the other, or another pose is no worse; or a shape has too few points,
        is flat, is no number, or is of another size.
    """
    ours, theirs = _side(moving, "moving", parameters), _side(fixed, "fixed", parameters)
    if max(ours.size, theirs.size) > LARGEST_RATIO * min(ours.size, theirs.size):
        raise Finding(f"shapes of {ours.size:.4g} mm and {theirs.size:.4g} mm, expected two of about one size")
    backward = isinstance(ours.surface, MeshSurface) and isinstance(theirs.surface, CloudSurface)
    if backward:
        ours, theirs = theirs, ours
    found, starts = candidates(sketch(ours.points), sketch(theirs.points))
    contenders, scale, starts = _contenders(found[:CONTENDERS], starts, ours, theirs)
    if len(contenders) > 1:
        _refuse_equals(contenders[:1], contenders[1:2], ours, theirs)
    best, scale, moved = settle(contenders[:1], ours.points, theirs.surface, WIDENED * scale, MOST_STEPS)
    held, way = stiffness(best, ours.points, theirs.surface, scale)
    if held < SOFTEST:
        raise Finding(f"ambiguous: {_slide(way)}, stiffness {held:.2g}, expected at least {SOFTEST}")
    if not moved < SETTLED_MM:
        raise Finding(f"the registration does not settle: its last step still moves the shape by {moved:.3g} mm")
    after = _residuals(best, ours, theirs, parameters)
    start = theirs.to_own.after(ours.to_own.inverse())
    whole = theirs.to_own.inverse().after(best).after(ours.to_own)
    return Registration(
        transform=_matrix(whole.inverse() if backward else whole).tolist(),
        before=_residuals(start, ours, theirs, parameters),
        after=after,
        runner_up=_residuals(contenders[1:2], ours, theirs, parameters) if len(contenders) > 1 else None,
        starts=len(start_poses()),
        agreeing=int(starts[0]),
        stiffness=held,
        verdict="same shape" if after.inliers >= MATCHING_SHARE * after.overlap else "different shapes",
    )


def _side(shape: Shape, name: str, parameters: RegistrationParameters) -> _Side:
    vertices, faces = np.asarray(shape[0], np.float64), np.asarray(shape[1])
    wrong = np.count_nonzero(~np.all(np.abs(vertices) <= FARTHEST_MM, axis=1))
    if wrong:
        raise Finding(f"{name}: {wrong} of {len(vertices)} points are no numbers or beyond {FARTHEST_MM:g} mm")
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
            raise Finding(f"{name}: {len(own)} of {len(points)} points lie apart, expected at least {FEWEST_POINTS}")
        surface = CloudSurface(dense)
    return _Side(own[np.random.default_rng(0).permutation(len(own))], surface, to_own, size)


def _thinned(points: Floats, size: float, count: int) -> Floats:
    """At most `count` of `points`, which lie around the origin, evenly spread: the first in each cell of a grid.

    A cell is centred at the origin, so that turning an axis round changes nothing. Doubled points become one.
    """
    cell = size / FINEST_CELLS
    while True:
        order, starts = group_by_cell(points + cell / 2, np.full(3, cell))
        if len(starts) <= count:
            return points[np.sort(order[starts])]
        cell *= max(1.02, np.sqrt(len(starts) / count))


def _contenders(
    poses: Poses, starts: NDArray[np.intp], ours: _Side, theirs: _Side
) -> tuple[Poses, float, NDArray[np.intp]]:
    """The distinct among candidates after few points were held against the surface itself, the best first.

    With Tukey's scale of the best, and the starts of each.
    """
    few, scale = ours.points[:CONTENDER_POINTS], FIRST_SCALE * theirs.size
    settled = [settle(poses[k : k + 1], few, theirs.surface, scale, CONTENDER_STEPS) for k in range(len(poses))]
    best_first = np.argsort([_squares(pose, ours, theirs, CONTENDER_POINTS).mean() for pose, _, _ in settled])
    rotations = np.concatenate([pose.rotations for pose, _, _ in settled])[best_first]
    translations = np.concatenate([pose.translations for pose, _, _ in settled])[best_first]
    contenders, starts = distinct(
        Poses(rotations, translations), starts[best_first], ours.points, SAME_POSE * theirs.size
    )
    return contenders, settled[best_first[0]][1], starts


def _squares(pose: Poses, ours: _Side, theirs: _Side, points: int | None) -> Floats:
    """Capped squared distances both ways, for a part fits into a whole, but not the whole into it."""
    cap = CAPPED * theirs.size
    there = capped_squares(pose, ours.points[:points], theirs.surface, cap)[0]
    back = capped_squares(pose.inverse(), theirs.points[:points], ours.surface, cap)[0]
    return np.concatenate([there, back])


def _refuse_equals(best: Poses, other: Poses, ours: _Side, theirs: _Side) -> None:
    squares, others = _squares(best, ours, theirs, None), _squares(other, ours, theirs, None)
    here, there = patches_of(ours.points), patches_of(theirs.points)
    certainty = evidence(squares, others, np.concatenate([here, here.max() + 1 + there]))
    rms, other_rms = np.sqrt(squares.mean()), np.sqrt(others.mean())
    if certainty < CERTAIN or other_rms - rms < TELLING_MM:
        turn = Rotation.from_matrix(other.after(best.inverse()).rotations[0]).magnitude()
        raise Finding(
            f"ambiguous: a pose turned by {np.degrees(turn):.1f} degrees is as good, rms {other_rms:.3f} mm against "
            f"{rms:.3f} mm ({certainty:.1f} standard deviations better, expected at least {CERTAIN:g})"
        )


def _slide(way: Floats) -> str:
    turn, shift = np.linalg.norm(way[:3]), np.linalg.norm(way[3:])
    return "the shape turns on itself" if turn > shift else "the shape slides along itself"


def _residuals(pose: Poses, ours: _Side, theirs: _Side, parameters: RegistrationParameters) -> Residuals:
    fit = fit_of(pose, ours.points, theirs.surface)
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

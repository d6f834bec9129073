"""Where the reference object really stood: a placement that is wrong is told, one that is a little off is put right.

All cameras see the same object. What one camera could take for a fault of its own map, the others see too.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from footscan.calibration.capture.edge_points import EdgePoints, edge_distances, edge_points, to_object
from footscan.calibration.capture.reference import Edges
from footscan.calibration.models.fit import Fit, UndeterminedError, fit
from footscan.calibration.models.homography import HomographyModel
from footscan.calibration.models.selection import held_out_residuals, rms
from footscan.robust import MAD_TO_SD

Floats = NDArray[np.float64]
ToWorld = Callable[[Floats], Floats]

GATES_MM = (1.5, 1.0, 0.6, 0.3)
"""How far from its edge a point may lie: from the first map, which knows of no lens, to one that does."""
SPREADS = 6.0
"""And at last, in standard deviations."""
LEAST_GATE_MM = 0.06
NEAR_MM = 0.5
"""A point as near to an edge as this lies on it, whatever the lens."""
LOST_MM, LOST_STEP_MM = 60.0, 7.5
"""How far around its place a lost object is looked for, and how densely."""
REGISTER_GATES_MM = (12.0, 4.0, 1.5)
STAY = 0.01
"""How much a departure counts beside the distances: enough to keep the object from sliding along the edges seen."""
LOST_TURNS = np.radians([-8.0, 0.0, 8.0])
FOUND = 0.6
"""An object is found where so much of the stripe lies on its edges."""
SAMPLE = 600
"""Points of a placement, all cameras together, by which it is found."""
HELPS = 0.95
"""Poses on which the cameras agree are used where they bring the held-out error to this share of it or less."""
POSE_SIGMA = np.array([0.3, 0.3, 0.005])
"""How well a person places the object: mm, mm, radians."""
NOISE_MM = 0.02


@dataclass(frozen=True)
class CameraFit:
    """The map of a camera that knows of its lens, and the stripe points that it rests on."""

    points: EdgePoints
    fit: Fit

    def world(self, pixels: Floats) -> Floats:
        """Y and Z, (N, 2) mm, of `pixels` (N, 2)."""
        return self.fit.model.world(self.fit.parameters, pixels)


@dataclass(frozen=True)
class Departure:
    """How a placement departs from what the reference object's file says."""

    pose: Floats
    """(3,) mm, mm, radians to be added to the pose."""
    share: float
    """Of the stripe that lies on the object's edges then."""


def fit_to_edges(
    stripes: Sequence[Floats], first: ToWorld, edges: Edges, poses: Floats, model: HomographyModel
) -> CameraFit:
    """The map that brings the stripe onto the edges, from a first one that is good to a millimetre.

    Parameters
    ----------
    stripes : for each of K placements the points (N, 2), px.
    first : pixels (N, 2) to Y and Z (N, 2), mm.
    poses : (K, 3) mm, mm, radians.

    Raises
    ------
    UndeterminedError
        Too little of the stripe lies on edges.
    """

    def fitted(world: ToWorld, gate: float) -> CameraFit:
        points = edge_points(stripes, world, edges, poses, gate)
        return CameraFit(points, fit(model, points.observations(), robust=True))

    found = fitted(first, GATES_MM[0])
    for gate in GATES_MM[1:]:
        found = fitted(found.world, gate)
    spread = MAD_TO_SD * float(np.median(np.abs(found.fit.residuals)))
    return fitted(found.world, max(SPREADS * spread, LEAST_GATE_MM))


def departure(worlds: Sequence[Floats], edges: Edges, pose: Floats) -> Departure:
    """How the object stands in one placement, against its `pose` (3,), by what all cameras see of it.

    `worlds` holds for each camera the world points (N, 2) of its stripe, mm, by a map that does not rest on this
    placement. Where the object is not found near its pose, it is looked for around it.
    """
    points = np.concatenate([np.empty((0, 2)), *worlds])
    points = points[:: max(1, -(-len(points) // SAMPLE))]
    found = _register(points, edges, pose, np.zeros(3))
    if found.share >= FOUND or not len(points):
        return found
    steps = np.arange(-LOST_MM, LOST_MM + 1.0, LOST_STEP_MM)
    starts = np.array([(y, z, turn) for turn in LOST_TURNS for y in steps for z in steps])
    misfit = [float(np.mean(np.minimum(_distances(points, edges, pose + start), LOST_STEP_MM))) for start in starts]
    best = np.argsort(misfit, kind="stable")[:8]
    return max((_register(points, edges, pose, starts[k]) for k in best), key=lambda d: d.share)


def agreed_poses(cameras: Mapping[int, CameraFit], poses: Floats, without: int | None = None) -> Floats:
    """Poses (K, 3) that bring all cameras' stripes closest to the edges, the maps being free to follow.

    Gauss-Newton with the maps eliminated (Triggs et al. 2000, "Bundle adjustment", section 6.1): each camera adds to a
    small system in the poses. A prior holds them near to what was said, which also fixes what the maps could undo.
    """
    count = 3 * len(poses)
    precision = np.tile((NOISE_MM / POSE_SIGMA) ** 2, len(poses))
    normal, gradient = np.diag(precision), np.zeros(count)
    for camera, known in cameras.items():
        if camera == without:
            continue
        points = known.points
        model, parameters = known.fit.model, known.fit.parameters
        weights = points.observations().share
        world = model.world(parameters, points.pixels)
        residuals = points.across(world)
        by_map = np.einsum("nk,nkp->np", points.normals, model.by_parameters(parameters, points.pixels))
        by_pose = _by_poses(points, world, poses)
        inner = by_map.T @ (weights[:, None] * by_map) + np.diag(model.prior_precision() + 1e-12)
        mixed = by_map.T @ (weights[:, None] * by_pose)
        scale = np.sqrt(np.diagonal(inner))
        right = np.column_stack([mixed, by_map.T @ (weights * residuals)]) / scale[:, None]
        solved = np.linalg.solve(inner / np.outer(scale, scale), right) / scale[:, None]
        normal = normal + by_pose.T @ (weights[:, None] * by_pose) - mixed.T @ solved[:, :count]
        gradient = gradient + by_pose.T @ (weights * residuals) - mixed.T @ solved[:, count]
    return np.asarray(poses - np.linalg.solve(normal, gradient).reshape(-1, 3))


def joined_poses(cameras: Mapping[int, CameraFit], edges: Edges, poses: Floats) -> tuple[Floats, float, float]:
    """Poses on which the cameras agree, where that helps; and the held-out error, mm, as said and as agreed.

    Each camera is judged with the poses that the others agree on, which know nothing of it; its own map is judged on
    edges held out of its fit.
    """
    said: list[Floats] = []
    agreed: list[Floats] = []
    for camera, known in cameras.items():
        others = agreed_poses(cameras, poses, without=camera)
        for residuals, where in ((said, poses), (agreed, others)):
            observations = known.points.placed(edges, where).observations()
            try:
                found = fit(known.fit.model, observations, robust=True)
            except UndeterminedError:
                continue
            held_out = held_out_residuals(found, observations, robust=True)
            if held_out is not None:
                residuals.append(held_out)
    if len(cameras) < 2 or not said or not agreed:
        return poses, np.nan, np.nan
    before, after = rms(np.concatenate(said)), rms(np.concatenate(agreed))
    if after > HELPS * before:
        return poses, before, after
    return agreed_poses(cameras, poses), before, after


def _by_poses(points: EdgePoints, world: Floats, poses: Floats) -> Floats:
    """Derivatives (N, 3 K) of the residuals by the poses: shifts along the normal, turns about the object's origin."""
    own = world - poses[points.placement, :2]
    turn = points.normals[:, 1] * own[:, 0] - points.normals[:, 0] * own[:, 1]
    by_pose = np.zeros((len(points), 3 * len(poses)))
    rows = np.arange(len(points))
    by_pose[rows, 3 * points.placement] = -points.normals[:, 0]
    by_pose[rows, 3 * points.placement + 1] = -points.normals[:, 1]
    by_pose[rows, 3 * points.placement + 2] = -turn
    return by_pose


def _register(points: Floats, edges: Edges, pose: Floats, start: Floats) -> Departure:
    """The departure near to `start` (3,) that brings points onto edges; what lies far from all of them has no say."""
    scale = np.array([1.0, 1.0, 0.02])
    found = start
    for gate in REGISTER_GATES_MM:
        near = points[_distances(points, edges, pose + found) < gate]
        if not len(near):
            break
        stay = STAY * np.sqrt(len(near))

        def residuals(scaled: Floats, near: Floats = near, stay: float = stay) -> Floats:
            return np.append(_distances(near, edges, pose + scaled * scale), stay * (scaled - start / scale))

        found = least_squares(residuals, found / scale, loss="soft_l1", f_scale=0.3, max_nfev=40).x * scale
    share = float(np.mean(_distances(points, edges, pose + found) < NEAR_MM)) if len(points) else 0.0
    return Departure(np.asarray(found), share)


def _distances(points: Floats, edges: Edges, pose: Floats) -> Floats:
    """Distances (N,), mm, of points (N, 2) from the edge nearest to each."""
    return edge_distances(edges, to_object(points, np.broadcast_to(pose, (len(points), 3))))[1]

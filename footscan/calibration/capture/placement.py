"""Actual poses of the reference object: departures from the nominal placements are measured, small ones corrected.

All cameras see the same object. An error of its pose, which one camera could ascribe to its map, is seen by all.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from footscan.calibration.capture.edge_points import EdgePoints, edge_distances, edge_points, to_object
from footscan.calibration.capture.reference import Edges
from footscan.calibration.models.fit import ModelFit, UndeterminedError, fit
from footscan.calibration.models.homography import HomographyModel
from footscan.calibration.models.selection import held_out_residuals, rms
from footscan.robust import MAD_TO_SD

Floats = NDArray[np.float64]
ToWorld = Callable[[Floats], Floats]

GATES_MM = (1.5, 1.0, 0.6, 0.3)
"""Distances from an edge within which points are used, from the first map, without distortion, to the next ones. Chosen
by hand."""
SPREADS = 6.0
"""Last distance within which points are used, in standard deviations. Chosen by hand."""
LEAST_GATE_MM = 0.06
"""Lower bound of that distance. Chosen by hand."""
NEAR_MM = 0.5
"""Distance up to which a point lies on an edge, whatever the distortion. Chosen by hand."""
LOST_MM, LOST_STEP_MM = 60.0, 7.5
"""Distance from its place within which an object is searched, and the step of the search. Chosen by hand."""
LOST_TURNS = np.radians([-8.0, 0.0, 8.0])
"""Rotations at which an object is searched. Chosen by hand."""
LOST_STARTS = 8
"""Number of the best places of the search that are registered: a bound of time."""
REGISTER_GATES_MM = (12.0, 4.0, 1.5)
"""Distances from an edge within which points are used, in each step of a registration. Chosen by hand."""
REGISTER_SCALE = np.array([1.0, 1.0, 0.02])
"""Scale of the pose in a registration, mm, mm and radians: about the same motion of the object's corners."""
REGISTER_SOFT_MM, REGISTER_CALLS = 0.3, 40
"""Distance from which a point loses weight in a registration, chosen by hand; evaluations at most, a bound of time."""
STAY = 0.01
"""Weight of a departure relative to the distances, so that the object does not slide along the visible edges. Chosen by
hand."""
LEAST_SHARE = 0.6
"""Share of the stripe on the object's edges from which no search is needed. Chosen by hand."""
LEVER_MM = 50.0
"""Distance of the object's corners from its origin, about: a rotation moves them by this times its angle."""
SAMPLE = 600
"""Points of a placement, of all cameras together, that are used: a bound of time."""
HELPS = 0.95
"""Ratio of held-out errors up to which the poses on which the cameras agree are used. Chosen by hand."""
POSE_SIGMA = np.array([0.3, 0.3, 0.005])
"""Prior standard deviation with which a person places the object: mm, mm, radians. Chosen by hand."""
NOISE_MM = 0.02
"""Standard deviation of the data by which they are weighed against that prior. Chosen by hand."""
ROUNDING = 1e-12
"""Precision that is added to all parameters of a map, so that their equations are regular."""


@dataclass(frozen=True)
class CameraFit:
    """A map with distortion, and the points of the stripe to which it was fitted."""

    points: EdgePoints
    fit: ModelFit

    def world(self, pixels: Floats) -> Floats:
        """Y and Z, (N, 2) mm, of `pixels` (N, 2), px."""
        return self.fit.model.world(self.fit.parameters, pixels)


@dataclass(frozen=True)
class Departure:
    """The departure of the object from its nominal pose in one placement."""

    pose: Floats
    """(3,) mm, mm, radians, to be added to the nominal pose."""
    share: float
    """Share of the stripe that then lies on the object's edges."""

    @property
    def size_mm(self) -> float:
        """The way of the object, or that of its corners if it is turned more than moved, mm."""
        return max(float(np.hypot(*self.pose[:2])), float(abs(self.pose[2])) * LEVER_MM)


def fit_to_edges(
    stripes: Sequence[Floats], first: ToWorld, edges: Edges, poses: Floats, model: HomographyModel
) -> CameraFit:
    """Fit the map that brings the stripe onto the edges, from a first map that is accurate to a millimetre.

    Parameters
    ----------
    stripes : for each of K placements the points (N, 2), px.
    first : maps pixels (N, 2) to Y and Z (N, 2), mm.
    poses : (K, 3) of the object, mm, mm, radians.

    Raises
    ------
    UndeterminedError
        Too little of the stripe lies on edges.
    """

    def fitted(world: ToWorld, gate: float) -> CameraFit:
        points = edge_points(stripes, world, edges, poses, gate)
        return CameraFit(points, fit(model, points.observations(), robust=True))

    camera = fitted(first, GATES_MM[0])
    for gate in GATES_MM[1:]:
        camera = fitted(camera.world, gate)
    spread = MAD_TO_SD * float(np.median(np.abs(camera.fit.residuals)))
    return fitted(camera.world, max(SPREADS * spread, LEAST_GATE_MM))


def departure(worlds: Sequence[Floats], edges: Edges, pose: Floats) -> Departure:
    """Measure the departure of the object from its nominal `pose` (3,) in one placement, with all cameras.

    `worlds` are, for each camera, the world points (N, 2) of its stripe, mm, by a map fitted without this placement. If
    the object is not near its nominal pose, it is searched in the surroundings.
    """
    points = np.concatenate([np.empty((0, 2)), *worlds])
    points = points[:: max(1, -(-len(points) // SAMPLE))]
    nearby = _register(points, edges, pose, np.zeros(3))
    if nearby.share >= LEAST_SHARE or not len(points):
        return nearby
    steps = np.arange(-LOST_MM, LOST_MM + 1.0, LOST_STEP_MM)
    starts = np.array([(y, z, turn) for turn in LOST_TURNS for y in steps for z in steps])
    misfit = [float(np.mean(np.minimum(_distances(points, edges, pose + start), LOST_STEP_MM))) for start in starts]
    best = np.argsort(misfit, kind="stable")[:LOST_STARTS]
    return max((_register(points, edges, pose, starts[k]) for k in best), key=lambda d: d.share)


def agreed_poses(cameras: Mapping[int, CameraFit], poses: Floats, without: int | None = None) -> Floats:
    """Estimate the poses (K, 3) that bring the stripes of all cameras closest to the edges, with the maps free.

    One Gauss-Newton step with the maps eliminated, so that each camera adds to a small system in the poses (B. Triggs
    et al., "Bundle adjustment - a modern synthesis", 2000, section 6.1, doi:10.1007/3-540-44480-7_21). A prior keeps
    the poses near their nominal values. It also determines the motions that the maps could compensate.

    Parameters
    ----------
    cameras : camera -> its map.
    poses : (K, 3) nominal poses, mm, mm, radians.
    without : number of a camera to leave out.
    """
    count = 3 * len(poses)
    precision = np.tile((NOISE_MM / POSE_SIGMA) ** 2, len(poses))
    normal, gradient = np.diag(precision), np.zeros(count)
    for camera, camera_fit in cameras.items():
        if camera == without:
            continue
        points = camera_fit.points
        model, parameters = camera_fit.fit.model, camera_fit.fit.parameters
        weights = points.observations().share
        world = model.world(parameters, points.pixels)
        residuals = points.across(world)
        by_map = np.einsum("nk,nkp->np", points.normals, model.by_parameters(parameters, points.pixels))
        by_pose = _by_poses(points, world, poses)
        inner = by_map.T @ (weights[:, None] * by_map) + np.diag(model.prior_precision() + ROUNDING)
        mixed = by_map.T @ (weights[:, None] * by_pose)
        scale = np.sqrt(np.diagonal(inner))
        right = np.column_stack([mixed, by_map.T @ (weights * residuals)]) / scale[:, None]
        solved = np.linalg.solve(inner / np.outer(scale, scale), right) / scale[:, None]
        normal = normal + by_pose.T @ (weights[:, None] * by_pose) - mixed.T @ solved[:, :count]
        gradient = gradient + by_pose.T @ (weights * residuals) - mixed.T @ solved[:, count]
    return np.asarray(poses - np.linalg.solve(normal, gradient).reshape(-1, 3))


def joined_poses(cameras: Mapping[int, CameraFit], edges: Edges, poses: Floats) -> tuple[Floats, float, float]:
    """Correct the poses (K, 3) if that lowers the held-out error of the cameras.

    Each camera is judged with the poses on which the other cameras agree, which are independent of it. Its map is
    judged on edges held out of its fit.

    Returns
    -------
    The poses (K, 3), and the held-out errors, mm, with the nominal and with the agreed poses; NaN if unknown.
    """
    nominal: list[Floats] = []
    agreed: list[Floats] = []
    for camera, camera_fit in cameras.items():
        others = agreed_poses(cameras, poses, without=camera)
        for residuals, tried_poses in ((nominal, poses), (agreed, others)):
            observations = camera_fit.points.placed(edges, tried_poses).observations()
            try:
                fitted = fit(camera_fit.fit.model, observations, robust=True)
            except UndeterminedError:
                continue
            held_out = held_out_residuals(fitted, observations, robust=True)
            if held_out is not None:
                residuals.append(held_out)
    if len(cameras) < 2 or not nominal or not agreed:
        return poses, np.nan, np.nan
    before, after = rms(np.concatenate(nominal)), rms(np.concatenate(agreed))
    if after > HELPS * before:
        return poses, before, after
    return agreed_poses(cameras, poses), before, after


def _by_poses(points: EdgePoints, world: Floats, poses: Floats) -> Floats:
    """Derivatives (N, 3 K) of the residuals by the poses: by shifts, and by rotations about the object's origin."""
    own = world - poses[points.placement, :2]
    turn = points.normals[:, 1] * own[:, 0] - points.normals[:, 0] * own[:, 1]
    by_pose = np.zeros((len(points), 3 * len(poses)))
    rows = np.arange(len(points))
    by_pose[rows, 3 * points.placement] = -points.normals[:, 0]
    by_pose[rows, 3 * points.placement + 1] = -points.normals[:, 1]
    by_pose[rows, 3 * points.placement + 2] = -turn
    return by_pose


def _register(points: Floats, edges: Edges, pose: Floats, start: Floats) -> Departure:
    """The departure near `start` (3,) that brings points onto edges; points far from all edges are ignored."""
    scale = REGISTER_SCALE
    change = start
    for gate in REGISTER_GATES_MM:
        near = points[_distances(points, edges, pose + change) < gate]
        if not len(near):
            break
        stay = STAY * np.sqrt(len(near))

        def residuals(scaled: Floats, near: Floats = near, stay: float = stay) -> Floats:
            return np.append(_distances(near, edges, pose + scaled * scale), stay * (scaled - start / scale))

        solution = least_squares(
            residuals, change / scale, loss="soft_l1", f_scale=REGISTER_SOFT_MM, max_nfev=REGISTER_CALLS
        )
        change = solution.x * scale
    share = float(np.mean(_distances(points, edges, pose + change) < NEAR_MM)) if len(points) else 0.0
    return Departure(np.asarray(change), share)


def _distances(points: Floats, edges: Edges, pose: Floats) -> Floats:
    """Distances (N,), mm, of points (N, 2) from the nearest edge of the object in `pose` (3,)."""
    return edge_distances(edges, to_object(points, np.broadcast_to(pose, (len(points), 3))))[1]

"""Robust point-to-plane ICP of many poses at once.

Chen & Medioni, "Object modelling by registration of multiple range images", 1992, with Tukey's weights, whose scale
follows the residuals (Bergstroem & Edlund, "Robust registration of point sets using iteratively reweighted least
squares", 2014).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from footscan.robust import MAD_TO_SD, TUKEY
from footscan.verify.nearest import Floats, Surface

DAMPING = 1e-6
"""Share of the mean diagonal that is added to the normal matrix, so that unconstrained directions do not move."""
LONGEST_TURN = 0.3
"""Largest rotation of a step, radians; chosen by hand."""
SETTLED_MM = 1e-4
"""A step that moves no point by more is the last."""
CALMED_AFTER = 50
"""Number of steps after which steps are shortened, since a pose may alternate between triangles; chosen by hand."""
CALMING = 0.05
"""Weight of the offset along the surface that shortens such steps; chosen by hand."""
SHRINKING = 0.7
"""Least factor of Tukey's scale from step to step, so that points that fit already do not outvote those that do not fit
yet. Graduated non-convexity: Blake & Zisserman, "Visual Reconstruction", 1987. Chosen by hand."""
STEADY = 0.999
"""Share of Tukey's scale that the last step must keep; chosen by hand."""
SMALLEST_SCALE_MM = 0.02
"""Least scale of Tukey's biweight, for shapes without noise; chosen by hand."""


@dataclass(frozen=True)
class Poses:
    """S rigid transforms: a point p moves to `rotations` p + `translations`."""

    rotations: Floats
    """(S, 3, 3), determinant +1"""
    translations: Floats
    """(S, 3) mm"""

    def __len__(self) -> int:
        return len(self.rotations)

    def __getitem__(self, chosen: NDArray[np.integer] | slice) -> "Poses":
        return Poses(self.rotations[chosen], self.translations[chosen])

    def place(self, points: Floats) -> Floats:
        """Returns (S, N, 3) the `points`, (N, 3), in each of the poses."""
        # Not by matmul: the order of BLAS's sums may depend on the number of threads.
        placed: Floats = np.einsum("sij,nj->sni", self.rotations, points) + self.translations[:, None]
        return placed

    def after(self, first: "Poses") -> "Poses":
        """The composition of `first` and then these poses."""
        rotations = np.einsum("sij,sjk->sik", self.rotations, first.rotations)
        return Poses(rotations, np.einsum("sij,sj->si", self.rotations, first.translations) + self.translations)

    def inverse(self) -> "Poses":
        turned = np.swapaxes(self.rotations, 1, 2)
        return Poses(turned, -np.einsum("sij,sj->si", turned, self.translations))


@dataclass(frozen=True)
class PoseFit:
    """Distances of points in S poses from a surface."""

    distances: Floats
    """(S, N) mm"""
    within: NDArray[np.bool_]
    """(S, N) as in `Nearest`"""


def fit_of(poses: Poses, points: Floats, surface: Surface) -> PoseFit:
    """Compute the distances of `points`, (N, 3) mm, from `surface` in each pose."""
    placed = poses.place(points)
    nearest = surface.nearest(placed.reshape(-1, 3))
    distances = np.linalg.norm(placed.reshape(-1, 3) - nearest.places, axis=1)
    return PoseFit(distances.reshape(placed.shape[:2]), nearest.within.reshape(placed.shape[:2]))


def capped_squares(poses: Poses, points: Floats, surface: Surface, cap: float) -> Floats:
    """Returns (S, N) squared distances in mm², capped at `cap`, and equal to it where the surface ends."""
    fit = fit_of(poses, points, surface)
    return np.square(np.where(fit.within, np.minimum(fit.distances, cap), cap))


def settle(pose: Poses, points: Floats, surface: Surface, scale: float, most_steps: int) -> tuple[Poses, float, float]:
    """Refine one pose until steps no longer move it, while the robust scale follows the residuals down.

    Returns
    -------
    the pose, the last Tukey's scale in mm, and the movement of the last step in mm
    """
    moved = np.inf
    for count in range(most_steps):
        # Offsets from a mesh have no part along the surface, so that this weight merely shortens the steps.
        along = 0.0 if count < CALMED_AFTER else CALMING
        pose, moves, fit = step(pose, points, surface, np.array([scale]), along)
        moved = float(moves[0])
        near = fit.distances[fit.within & (fit.distances < scale)]
        if not len(near):
            return pose, scale, np.inf
        new_scale = max(TUKEY * MAD_TO_SD * float(np.median(near)), SMALLEST_SCALE_MM)
        if moved < SETTLED_MM and new_scale > STEADY * scale:
            break
        scale = min(scale, max(new_scale, SHRINKING * scale))
    return pose, scale, moved


def step(poses: Poses, points: Floats, surface: Surface, scale: Floats, along: float) -> tuple[Poses, Floats, PoseFit]:
    """Take one Gauss-Newton step of each pose towards the least robust distance.

    Parameters
    ----------
    points : (N, 3) mm, centred at the origin, the centre of rotation
    scale : (S,) mm, distance at which a point loses its weight
    along : weight of the offset along the surface, 0 for point-to-plane

    Returns
    -------
    the poses after the step, (S,) an upper bound in mm of the movement of any point, and the fit before the step
    """
    placed = poses.place(points)
    count, size = placed.shape[:2]
    nearest = surface.nearest(placed.reshape(-1, 3))
    offsets = (placed.reshape(-1, 3) - nearest.places).reshape(count, size, 3)
    distances = np.linalg.norm(offsets, axis=2)
    within = nearest.within.reshape(count, size)
    weights = np.where(within, tukey_weights(distances, scale[:, None]), 0.0)
    radius = float(np.linalg.norm(points, axis=1).max())
    arms = (placed - poses.translations[:, None]) / radius
    normals = nearest.normals.reshape(count, size, 3)
    matrix, vector = normal_equations(arms, normals, offsets, weights, along)
    damping = DAMPING * np.trace(matrix, axis1=1, axis2=2) / 6 + 1e-12
    change = -np.linalg.solve(matrix + damping[:, None, None] * np.eye(6), vector[:, :, None])[:, :, 0]
    turns, shifts = change[:, :3] / radius, change[:, 3:]
    shorten = np.minimum(1.0, LONGEST_TURN / np.maximum(np.linalg.norm(turns, axis=1, keepdims=True), 1e-12))
    turns, shifts = shorten * turns, shorten * shifts
    rotations = Rotation.from_rotvec(turns).as_matrix()
    moved = Poses(np.einsum("sij,sjk->sik", rotations, poses.rotations), poses.translations + shifts)
    movement = np.linalg.norm(turns, axis=1) * radius + np.linalg.norm(shifts, axis=1)
    return moved, movement, PoseFit(distances, within)


def normal_equations(
    arms: Floats, normals: Floats, offsets: Floats, weights: Floats, along: float
) -> tuple[Floats, Floats]:
    """Returns (S, 6, 6) and (S, 6): the weighted means of J'J and of J'r for three rotations and three translations.

    Parameters
    ----------
    arms : (S, N, 3) from the centre of rotation to the points
    normals : (S, N, 3) of the surface
    offsets : (S, N, 3) from the surface to the points
    weights : (S, N)
    along : weight of the offset along the surface
    """
    across = np.concatenate([np.cross(arms, normals), normals], axis=2)
    gap = np.einsum("sni,sni->sn", normals, offsets)
    total = np.maximum(weights.sum(axis=1), 1e-12)[:, None]
    share = weights / total
    matrix = np.einsum("sn,sni,snj->sij", share, across, across)
    vector = np.einsum("sn,sn,sni->si", share, gap, across)
    if along:
        whole = np.concatenate(
            [np.cross(arms[..., None, :], np.eye(3)), np.broadcast_to(np.eye(3), (*arms.shape, 3))], 3
        )
        matrix += along * np.einsum("sn,snki,snkj->sij", share, whole, whole)
        vector += along * np.einsum("sn,snk,snki->si", share, offsets, whole)
    return matrix, vector


def tukey_weights(distances: Floats, scale: Floats) -> Floats:
    """Tukey's biweight: 1 at distance 0, 0 from `scale` on.

    Examples
    --------
    >>> tukey_weights(np.array([0.0, 1.0, 2.0, 3.0]), np.array([2.0])).tolist()
    [1.0, 0.5625, 0.0, 0.0]
    """
    weights: Floats = np.square(np.maximum(1 - np.square(distances / scale), 0.0))
    return weights

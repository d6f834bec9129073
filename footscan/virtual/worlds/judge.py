"""How far a reconstruction is from the truth of a world."""

import numpy as np
from numpy.typing import NDArray

from footscan.open3d_without_plots import o3d
from footscan.virtual.optics.scene import Mesh

Floats = NDArray[np.float64]

SAMPLE = 4000
"""Points that the pose is estimated from. Chosen by hand."""
ROUNDS = 40
"""Steps of the registration; it converges in fewer. Chosen by hand."""
ROUNDS_WITH_ALL = 12
"""First steps, in which all points count: trimmed at once, the ends of a foot that is off along X would be left out.
Chosen by hand."""
OUTLIER_MEDIANS, OUTLIER_MM = 3.0, 0.5
"""Then points count that are nearer than so many median distances, or than this: what is wrong must not pull the rest.
Chosen by hand."""
COVERED_MM = 5.0
"""A part of the surface is covered where a stripe point is nearer than this: travels have steps of up to 5 mm."""
LOWEST_MM, HIGHEST_MM = 2.0, 100.0
"""Heights between which coverage counts: below, the glass hides the foot's edge; above, no measure is taken."""


class Truth:
    """The true surface of a world."""

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            o3d.core.Tensor.from_numpy(mesh.vertices.astype(np.float32)),
            o3d.core.Tensor.from_numpy(mesh.faces.astype(np.uint32)),
        )

    def nearest(self, points: Floats) -> Floats:
        """Return the nearest places on the surface, (N, 3), mm."""
        query = o3d.core.Tensor.from_numpy(points.astype(np.float32))
        return np.asarray(self._scene.compute_closest_points(query)["points"].numpy(), np.float64)

    def distances(self, points: Floats) -> Floats:
        """Return distances (N,), mm."""
        return np.asarray(np.linalg.norm(self.nearest(points) - points, axis=1))

    def registered(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the rotation (3, 3) and the shift (3,), mm, that bring points onto the surface.

        Heads that are all off by the same X, or a plate that was tilted, move a scan as a whole; its measures stay.
        Iterative closest points, trimmed (D. Chetverikov et al., "The trimmed iterative closest point algorithm",
        2002).
        """
        chosen = np.linspace(0, len(points) - 1, min(SAMPLE, len(points))).astype(np.int64)
        sample = points[chosen]
        turn, shift = np.eye(3), np.zeros(3)
        for number in range(ROUNDS):
            moved = sample @ turn.T + shift
            target = self.nearest(moved)
            distance = np.linalg.norm(target - moved, axis=1)
            limit = max(OUTLIER_MEDIANS * float(np.median(distance)), OUTLIER_MM)
            kept = distance <= (np.inf if number < ROUNDS_WITH_ALL else limit)
            turn, shift = _rigid(sample[kept], target[kept])
        return turn, shift

    def covered(self, points: Floats) -> float:
        """Return the share of the surface's vertices that have one of `points` (N, 3) near them."""
        z = self._mesh.vertices[:, 2] - self._mesh.vertices[:, 2].min()
        vertices = self._mesh.vertices[(z > LOWEST_MM) & (z < HIGHEST_MM)]
        if not len(points) or not len(vertices):
            return 0.0
        from scipy.spatial import cKDTree

        near, _ = cKDTree(points).query(vertices, distance_upper_bound=COVERED_MM)
        return float(np.mean(np.isfinite(near)))


def _rigid(points: Floats, targets: Floats) -> tuple[Floats, Floats]:
    """The rotation and shift that bring points onto targets, both (N, 3), with the least squares (Kabsch, 1976)."""
    here, there = points.mean(axis=0), targets.mean(axis=0)
    u, _, vt = np.linalg.svd((points - here).T @ (targets - there))
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))])
    turn = vt.T @ mirror @ u.T
    return turn, there - turn @ here

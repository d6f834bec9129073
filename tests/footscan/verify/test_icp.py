import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from footscan.mesh.sampling import sample_surface
from footscan.verify.icp import Poses, capped_squares, normal_equations, settle, tukey_weights
from footscan.verify.nearest import MeshSurface

STAY = Poses(np.eye(3)[None], np.zeros((1, 3)))


def box() -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.creation.box(extents=(60, 40, 20))
    return np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32)


def test_tukeys_weights_by_hand() -> None:
    np.testing.assert_allclose(tukey_weights(np.array([0.0, 1, 2, 3]), np.array(2.0)), [1, 0.5625, 0, 0])


def test_poses_one_after_another() -> None:
    quarter = Poses(Rotation.from_euler("z", 90, degrees=True).as_matrix()[None], np.array([[1.0, 0, 0]]))
    points = np.array([[2.0, 3, 4]])
    np.testing.assert_allclose(quarter.place(points)[0], [[-2, 2, 4]], atol=1e-12)
    np.testing.assert_allclose(quarter.after(quarter).place(points)[0], [[-1, -2, 4]], atol=1e-12)
    np.testing.assert_allclose(quarter.inverse().after(quarter).place(points)[0], points, atol=1e-12)


def test_normal_equations_are_the_derivatives_of_the_distances() -> None:
    rng = np.random.default_rng(0)
    arms, normals, offsets = rng.normal(size=(3, 1, 7, 3))
    weights = rng.random((1, 7))
    matrix, vector = normal_equations(arms, normals, offsets, weights, 0.3)

    def cost(change: np.ndarray) -> float:
        moved = offsets + np.cross(change[:3], arms) + change[3:]
        across = np.sum(moved * normals, axis=2) ** 2
        return float(np.sum(weights * (across + 0.3 * np.sum(moved**2, axis=2))) / weights.sum() / 2)

    steps = 1e-4 * np.eye(6)
    slope = [(cost(step) - cost(-step)) / 2e-4 for step in steps]
    np.testing.assert_allclose(vector[0], slope, atol=1e-8)
    curved = [(cost(step) - 2 * cost(0 * step) + cost(-step)) / 1e-8 for step in steps]
    np.testing.assert_allclose(np.diag(matrix[0]), curved, rtol=1e-5)


def test_a_displaced_box_settles_where_it_was() -> None:
    points = sample_surface(*box(), 2000)
    displaced = Poses(Rotation.from_rotvec([[0.05, -0.04, 0.06]]).as_matrix(), np.array([[1.0, -2.0, 1.5]]))
    pose, scale, moved = settle(displaced, points, MeshSurface(box()), 10.0, 100)
    assert moved < 1e-4
    assert scale == 0.02  # no noise: the smallest
    np.testing.assert_allclose(pose.place(points)[0], points, atol=1e-4)


def test_outliers_do_not_move_it() -> None:
    points = sample_surface(*box(), 2000)
    points[::5] += [0, 0, 4.0]  # a fifth of the points lie 4 mm too high
    pose, _, moved = settle(STAY, points, MeshSurface(box()), 10.0, 200)
    assert moved < 1e-4
    corners = box()[0]
    np.testing.assert_allclose(pose.place(corners)[0], corners, atol=0.01)


def test_what_is_beyond_the_cap_or_the_rim_counts_as_the_cap() -> None:
    square = (np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]]), np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    points = np.array([[5.0, 4, 1], [5, 4, 7], [10.5, 4, 0]])
    assert capped_squares(STAY, points, MeshSurface(square), 3.0)[0] == pytest.approx([1, 9, 9])

"""The tree of triangles beside all triangles one by one."""

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.virtual.foot.foot import make_foot
from footscan.virtual.optics.ray_tree import RayTree, any_hits, first_hits, ray_tree
from footscan.virtual.stage.block import make_block

Floats = NDArray[np.float64]


def soup(triangles: int, seed: int) -> tuple[Floats, NDArray[np.int64]]:
    random = np.random.default_rng(seed)
    middles = random.uniform(-50.0, 50.0, (triangles, 1, 3))
    vertices = (middles + random.normal(0.0, 4.0, (triangles, 3, 3))).reshape(-1, 3)
    return vertices, np.arange(3 * triangles).reshape(-1, 3)


def rays(count: int, seed: int) -> tuple[Floats, Floats]:
    random = np.random.default_rng(seed)
    origins = random.uniform(-80.0, 80.0, (count, 3))
    return origins, random.uniform(-20.0, 20.0, (count, 3)) - origins


def one_by_one(vertices: Floats, faces: NDArray[np.int64], origin: Floats, direction: Floats) -> Floats:
    """Distance to each triangle, infinite where there is none, by solving for it."""
    corners = vertices[faces]
    matrices = np.stack(
        [corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], -np.broadcast_to(direction, (len(faces), 3))],
        axis=2,
    )
    u, v, t = np.linalg.solve(matrices, (origin - corners[:, 0])[:, :, None])[:, :, 0].T
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)


def test_first_hits_are_those_of_all_triangles() -> None:
    vertices, faces = soup(700, 1)
    origins, directions = rays(300, 2)
    met, distance, shares = first_hits(origins, directions, ray_tree(vertices, faces))
    for k in range(len(origins)):
        distances = one_by_one(vertices, faces, origins[k], directions[k])
        assert (met[k] >= 0) == np.isfinite(distances.min())
        if met[k] >= 0:
            assert met[k] == distances.argmin()
            assert distance[k] == pytest.approx(distances.min(), rel=1e-9)
            a, b, c = vertices[faces[met[k]]]
            point = a + shares[k, 0] * (b - a) + shares[k, 1] * (c - a)
            np.testing.assert_allclose(point, origins[k] + distance[k] * directions[k], atol=1e-9)
    assert (met >= 0).sum() > 50


def test_what_stands_between_is_within_reach() -> None:
    vertices, faces = soup(700, 3)
    origins, directions = rays(300, 4)
    tree = ray_tree(vertices, faces)
    met, distance, _ = first_hits(origins, directions, tree)
    reach = float(np.median(distance[met >= 0]))
    assert any_hits(origins, directions, reach, tree).tolist() == ((met >= 0) & (distance < reach)).tolist()


def test_a_sole_is_met_by_rays_that_begin_on_it() -> None:
    foot = make_foot(resolution_mm=2.0)
    origins = np.array([[30.0, 0.0, 0.0], [30.0, 0.0, 1e-9], [30.0, 0.0, -5.0]])
    directions = np.tile([0.0, 0.0, 1.0], (3, 1))
    met, distance, _ = first_hits(origins, directions, ray_tree(foot.vertices, foot.faces.astype(np.int64)))
    assert (met >= 0).all()
    np.testing.assert_allclose(distance, [0.0, 0.0, 5.0], atol=1e-3)


def test_no_ray_slips_through_an_edge_or_a_corner() -> None:
    vertices, faces = make_block((150.0, 100.0, 50.0))
    tree = ray_tree(vertices, faces.astype(np.int64))
    targets = np.concatenate([vertices, (vertices[faces[:, 0]] + vertices[faces[:, 1]]) / 2.0])
    middle = np.array([75.0, 0.0, 25.0])
    origins = np.tile(middle, (len(targets), 1))
    met, distance, _ = first_hits(origins, targets - middle, tree)
    assert (met >= 0).all()
    np.testing.assert_allclose(distance, 1.0, atol=1e-12)


def test_rays_along_the_axes_are_met() -> None:
    vertices, faces = make_block((150.0, 100.0, 50.0))
    origins = np.array(
        [[-10.0, 0.0, 25.0], [75.0, -90.0, 25.0], [75.0, 0.0, 90.0], [75.0, 0.0, -90.0], [-10.0, 0.0, 60.0]]
    )
    directions = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, -1.0], [0, 0, -1.0], [1.0, 0, 0]])
    met, distance, _ = first_hits(origins, directions, ray_tree(vertices, faces.astype(np.int64)))
    assert (met >= 0).tolist() == [True, True, True, False, False]
    assert distance[:3].tolist() == [10.0, 40.0, 40.0]


def test_of_two_equal_triangles_the_first_is_met() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    for faces in ([[0, 1, 2]] * 9, [[1, 2, 0], [0, 1, 2]]):
        tree: RayTree = ray_tree(vertices, np.array(faces))
        met, _, _ = first_hits(np.array([[0.2, 0.2, 3.0]]), np.array([[0.0, 0.0, -1.0]]), tree)
        assert met.tolist() == [0]


def test_a_mesh_without_area_is_met_nowhere() -> None:
    tree = ray_tree(np.zeros((3, 3)), np.array([[0, 1, 2]] * 20))
    met, _, _ = first_hits(np.array([[0.0, 0.0, 3.0]]), np.array([[0.0, 0.0, -1.0]]), tree)
    assert met.tolist() == [-1]

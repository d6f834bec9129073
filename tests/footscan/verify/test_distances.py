import numpy as np
import pytest
import trimesh

from footscan.verify.distances import BLOCK, distances_to_cloud, distances_to_mesh, signed_distances
from schemas.base.errors import RefusedInput

Mesh = tuple[np.ndarray, np.ndarray]


def box(size: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Mesh:
    mesh = trimesh.creation.box(extents=(size, size, size))
    return np.asarray(mesh.vertices) + np.array(centre), np.asarray(mesh.faces, np.int32)


def test_to_a_mesh_by_hand() -> None:
    points = np.array([[0.0, 0, 0], [0, 0, 7], [5, 5, 5], [8, 9, 5], [4, 0, 0]])
    distances = distances_to_mesh(points, box(10.0))
    assert distances.signed is not None
    np.testing.assert_allclose(distances.signed, [-5, 2, 0, 5, -1], atol=1e-6)
    np.testing.assert_allclose(distances.unsigned, [5, 2, 0, 5, 1], atol=1e-6)


def test_far_from_the_origin_nothing_is_lost() -> None:
    centre = (1e5, -2e5, 3e5)
    points = np.array(centre) + np.array([[0.0, 0, 5.001], [0, 0, 4.999]])
    np.testing.assert_allclose(signed_distances(points, box(10.0, centre)), [0.001, -0.001], atol=1e-6)


def test_the_orientation_of_faces_does_not_decide_what_is_inside() -> None:
    vertices, faces = box(10.0)
    assert signed_distances(np.zeros((1, 3)), (vertices, faces[:, ::-1]))[0] == pytest.approx(-5.0)


def test_blocks_join_without_a_seam() -> None:
    random = np.random.default_rng(0)
    points = random.uniform(-8, 8, (BLOCK + 1234, 3))
    cloud = random.uniform(-8, 8, (500, 3))
    outside = np.maximum(np.abs(points) - 5, 0)
    depth = np.max(np.abs(points) - 5, axis=1)
    expected = np.where(depth > 0, np.linalg.norm(outside, axis=1), depth)
    np.testing.assert_allclose(signed_distances(points, box(10.0)), expected, atol=2e-6)
    to_cloud = distances_to_cloud(points, cloud).unsigned
    for row in (0, BLOCK - 1, BLOCK, len(points) - 1):
        assert to_cloud[row] == pytest.approx(np.linalg.norm(cloud - points[row], axis=1).min(), rel=1e-6)


def test_between_clouds_by_hand() -> None:
    # A plane of points at Z = 0, 1 mm apart; 0.3 mm above it and 0.4 mm beside its points.
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(5.0), np.arange(5.0)))
    plane = np.column_stack([x, y, np.zeros(25)])
    upward = np.tile([0.0, 0, 1], (25, 1))
    points = plane + np.array([0.4, 0, 0.3])
    assert distances_to_cloud(points, plane).signed is None
    np.testing.assert_allclose(distances_to_cloud(points, plane).unsigned, 0.5, rtol=1e-6)
    along = distances_to_cloud(points, plane, upward)
    np.testing.assert_allclose(along.unsigned, 0.5, rtol=1e-6)
    np.testing.assert_allclose(along.signed, 0.3, rtol=1e-6)
    # The points' own normals serve where the cloud has none; the cloud's come first.
    np.testing.assert_allclose(distances_to_cloud(points, plane, None, -upward).signed, -0.3, rtol=1e-6)
    np.testing.assert_allclose(distances_to_cloud(points, plane, upward, -upward).signed, 0.3, rtol=1e-6)


def test_doubled_points_of_a_cloud_change_nothing() -> None:
    random = np.random.default_rng(0)
    points, cloud = random.normal(0, 5, (300, 3)), random.normal(0, 5, (200, 3))
    doubled = np.concatenate([np.repeat(cloud, 50, axis=0), cloud])
    np.testing.assert_array_equal(
        distances_to_cloud(points, doubled).unsigned, distances_to_cloud(points, cloud).unsigned
    )


@pytest.mark.parametrize("far", [np.nan, np.inf, -np.inf, 1e200, -1e8])
def test_coordinates_that_cannot_be_are_refused(far: float) -> None:
    good = np.random.default_rng(0).normal(0, 5, (10, 3))
    bad = good.copy()
    bad[7, 1] = far
    with pytest.raises(RefusedInput, match=r"shape: holds .*, expected mm"):
        signed_distances(bad, box(10.0))
    with pytest.raises(RefusedInput, match=r"reference: holds .*, expected mm"):
        distances_to_cloud(good, bad)
    with pytest.raises(RefusedInput, match=r"reference: holds .*, expected mm"):
        signed_distances(good, (bad, np.array([[0, 1, 2]], np.int32)))


def test_a_reference_without_a_surface_is_refused() -> None:
    points = np.zeros((4, 3))
    for faces in (np.zeros((0, 3), np.int32), np.array([[0, 1, 2], [0, 0, 1]], np.int32)):
        with pytest.raises(RefusedInput, match="reference: has no triangle with an area"):
            signed_distances(points, (np.arange(9.0).reshape(3, 3), faces))
    for single in (np.ones((1, 3)), np.ones((5, 3))):
        with pytest.raises(RefusedInput, match="reference: is a single point"):
            distances_to_cloud(points, single)

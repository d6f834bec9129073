import numpy as np

from footscan.verify.nearest import CloudSurface, MeshSurface

SQUARE = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def test_places_on_a_mesh_by_hand() -> None:
    nearest = MeshSurface((SQUARE, HALVES)).nearest(np.array([[3.0, 2, 5], [5, 5, -1], [4, 6, 0]]))
    np.testing.assert_allclose(nearest.places, [[3, 2, 0], [5, 5, 0], [4, 6, 0]], atol=1e-6)
    np.testing.assert_allclose(np.abs(nearest.normals), [[0, 0, 1]] * 3, atol=1e-6)
    assert nearest.within.tolist() == [True, True, True]  # the diagonal, too: both its sides are there


def test_beyond_the_rim_of_a_mesh_nothing_is_known() -> None:
    beyond = np.array([[13.0, 5, 4], [13, 14, 0], [-1, -1, 1], [5, 11, 2]])  # edges and corners
    nearest = MeshSurface((SQUARE, HALVES)).nearest(beyond)
    np.testing.assert_allclose(nearest.places, [[10, 5, 0], [10, 10, 0], [0, 0, 0], [5, 10, 0]], atol=1e-6)
    assert not nearest.within.any()


def test_from_an_edge_the_distance_grows_along_the_way_to_it() -> None:
    roof = np.array([[0.0, 0, 0], [10, 0, 0], [5, 8, -3], [5, -8, -3]])
    nearest = MeshSurface((roof, np.array([[0, 1, 2], [1, 0, 3]], np.int32))).nearest(np.array([[5.0, 0, 2]]))
    np.testing.assert_allclose(nearest.places, [[5, 0, 0]], atol=1e-6)
    np.testing.assert_allclose(nearest.normals, [[0, 0, 1]], atol=1e-6)
    assert nearest.within.all()  # a ridge is no rim


def test_planes_of_a_cloud_by_hand() -> None:
    grid = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0), [0.0]), axis=-1).reshape(-1, 3)
    nearest = CloudSurface(grid).nearest(np.array([[7.3, 8.4, 2.5], [25.0, 8, 0]]))
    np.testing.assert_allclose(nearest.places[0], [7.3, 8.4, 0], atol=1e-9)
    np.testing.assert_allclose(np.abs(nearest.normals[0]), [0, 0, 1], atol=1e-9)
    assert nearest.within.tolist() == [True, False]  # six spacings beside the last point

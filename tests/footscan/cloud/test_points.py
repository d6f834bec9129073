import numpy as np

from footscan.cloud.points import POINT_DTYPE, UNKNOWN_SIGMA_MM, coordinates, make_points, stripe_step


def test_fields_and_coordinates() -> None:
    points = make_points(np.array([[1.0, 2.0, 3.0], [400.0, -5.5, 0.25]]), camera=3, frame=np.array([7, 8]))
    assert points.dtype == POINT_DTYPE
    assert points["camera"].tolist() == [3, 3]
    assert points["frame"].tolist() == [7, 8]
    assert points["cameras"].tolist() == [1, 1]
    np.testing.assert_array_equal(points["sigma"], np.float32(UNKNOWN_SIGMA_MM))
    np.testing.assert_array_equal(coordinates(points), [[1.0, 2.0, 3.0], [400.0, -5.5, 0.25]])


def test_layout_is_the_same_on_every_machine() -> None:
    assert POINT_DTYPE.itemsize == 31
    assert POINT_DTYPE["x"].str == "<f4"
    assert POINT_DTYPE["source"].str == "<i4"


def test_storage_resolves_a_tenth_of_a_micrometre() -> None:
    x = 399.98765
    assert abs(coordinates(make_points(np.array([[x, 0.0, 0.0]]), camera=1))[0, 0] - x) < 1e-4


def test_the_step_is_told_camera_by_camera() -> None:
    xyz = np.array([[0.0, 0, 0], [0, 1, 0], [2, 0, 0], [4, 0, 0], [0.5, 0, 0], [2.5, 0, 0]])
    points = make_points(xyz, camera=np.array([1, 1, 1, 1, 2, 2]), frame=np.array([0, 0, 1, 2, 0, 1]))
    assert stripe_step(points) == 2.0
    assert stripe_step(points[:2]) == 0.0
    assert stripe_step(points[:0]) == 0.0

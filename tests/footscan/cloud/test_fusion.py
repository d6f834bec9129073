import numpy as np

from footscan.cloud.fusion import fuse
from footscan.cloud.points import coordinates, make_points
from schemas.parameters.fusion import FusionParameters

PARAMETERS = FusionParameters(cell_mm=0.5)


def test_two_cameras_become_one_sheet() -> None:
    y = np.arange(100) * 0.5
    first = make_points(np.column_stack([np.zeros(100), y, np.full(100, 10.0)]), camera=1, source=np.arange(100))
    second = make_points(np.column_stack([np.zeros(100), y, np.full(100, 10.2)]), camera=2, source=np.arange(100))
    cloud = fuse([first, second], PARAMETERS)
    assert len(cloud) == 100
    np.testing.assert_allclose(cloud["z"], 10.1, atol=1e-5)
    np.testing.assert_allclose(cloud["y"], y, atol=1e-5)


def test_stripe_planes_stay_apart() -> None:
    planes = make_points(np.array([[0.0, 1.0, 1.0], [2.0, 1.0, 1.0], [0.5, 1.0, 1.0]]), camera=1)
    np.testing.assert_array_equal(fuse([planes], PARAMETERS)["x"], [0.0, 0.5, 2.0])


def test_unsupported_points_do_not_pull_supported_ones() -> None:
    points = make_points(np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.1]]), camera=1, supported=np.array([True, False]))
    cloud = fuse([points], PARAMETERS)
    np.testing.assert_allclose(coordinates(cloud), [[0.0, 0.1, 0.0]], atol=1e-6)
    assert cloud["supported"].tolist() == [True]


def test_a_point_carries_the_origin_of_the_nearest() -> None:
    lonely = make_points(np.array([[0.0, 0.15, 0.0]]), camera=7, source=41, frame=9)
    pair = make_points(np.array([[0.0, -0.05, 0.0], [0.0, -0.04, 0.0]]), camera=2, source=np.array([5, 6]))
    cloud = fuse([lonely, pair], PARAMETERS)
    # The mean is y = 0.02; of -0.05, -0.04 and 0.15 the second is nearest.
    assert cloud[["camera", "source", "frame"]].tolist() == [(2, 6, 0)]


def test_order_of_cameras_does_not_matter() -> None:
    random = np.random.default_rng(0)
    clouds = [make_points(random.uniform(-5, 5, (200, 3)).round(1), camera=k, source=np.arange(200)) for k in (1, 2, 3)]
    assert fuse(clouds, PARAMETERS).tobytes() == fuse(clouds[::-1], PARAMETERS).tobytes()


def test_no_points() -> None:
    assert len(fuse([], PARAMETERS)) == 0
    assert len(fuse([make_points(np.zeros((0, 3)), camera=1)], PARAMETERS)) == 0

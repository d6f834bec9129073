import numpy as np
import pytest

from footscan.cloud.fusion.merge import Merged, merge
from footscan.cloud.fusion.stripes import sort_stripes
from footscan.cloud.points import coordinates, make_points
from schemas.parameters.fusion import FusionParameters

Y = np.arange(100) * 0.3


def row(
    z: float | np.ndarray, camera: int, sigma: float = 0.02, y: np.ndarray = Y, x: float = 0.0, **more: object
) -> np.ndarray:
    xyz = np.column_stack([np.full(len(y), x), y, np.broadcast_to(z, len(y))])
    return make_points(xyz, camera, 0, np.arange(len(y)), sigma=sigma, **more)


def merged(*clouds: np.ndarray, deviation: float = 0.0, **parameters: object) -> Merged:
    chosen = FusionParameters(**{"spacing_mm": 0.0} | parameters)
    stripes = sort_stripes(clouds)
    cameras = len(stripes.cameras)
    reach, deviations = np.full(cameras, chosen.contradiction_mm), np.full((cameras, cameras), deviation)
    return merge(stripes, stripes.yz, reach, deviations, chosen)


def inner(cloud: np.ndarray) -> np.ndarray:
    """Away from the ends of the stripes."""
    return cloud[(cloud["y"] > 2.0) & (cloud["y"] < 28.0)]


def test_the_mean_of_two_cameras_by_hand() -> None:
    # Weights 1 / 0.01^2 and 1 / 0.02^2, four to one: 10 + 0.05 / 5; sigma is 1 / sqrt(12500).
    cloud, contradicted = merged(row(10.0, 1, 0.01), row(10.05, 2, 0.02))
    np.testing.assert_allclose(inner(cloud)["z"], 10.01, atol=1e-5)
    assert set(inner(cloud)["cameras"].tolist()) == {2}
    assert set(inner(cloud)["camera"].tolist()) == {1}
    # The squares are 0.01^2 / 0.01^2 + 0.04^2 / 0.02^2 = 5, one less than two: larger by the root of 5.
    np.testing.assert_allclose(inner(cloud)["sigma"], np.sqrt(5 / 12500), rtol=1e-3)
    assert contradicted == {1: 0, 2: 0}


def test_points_that_agree_are_surer_than_each() -> None:
    cloud, _ = merged(row(10.0, 1), row(10.0, 2), row(10.0, 3), row(10.0, 4))
    np.testing.assert_allclose(inner(cloud)["sigma"], 0.01, rtol=1e-5)


def test_of_three_that_contradict_each_other_two_win() -> None:
    cloud, contradicted = merged(row(10.0, 1), row(10.5, 2, 0.01), row(10.02, 3))
    np.testing.assert_allclose(inner(cloud)["z"], 10.01, atol=1e-5)
    assert set(inner(cloud)["cameras"].tolist()) == {2}
    assert contradicted == {1: 0, 2: 100, 3: 0}


def test_of_two_that_contradict_each_other_none_wins() -> None:
    cloud, contradicted = merged(row(10.0, 1, 0.03), row(10.4, 2, 0.02))
    np.testing.assert_allclose(inner(cloud)["z"], 10.2, atol=0.01)
    np.testing.assert_allclose(inner(cloud)["sigma"], 0.2, atol=0.01)
    assert set(inner(cloud)["cameras"].tolist()) == {1}
    assert contradicted == {1: 0, 2: 0}


def test_of_two_pairs_that_contradict_each_other_none_wins() -> None:
    cloud, _ = merged(row(10.0, 1), row(10.4, 2), row(10.01, 3), row(10.41, 4))
    np.testing.assert_allclose(inner(cloud)["z"], 10.205, atol=0.01)
    assert inner(cloud)["sigma"].min() > 0.1
    assert set(inner(cloud)["cameras"].tolist()) == {1}


def test_cameras_that_always_differ_by_so_much_do_not_contradict_each_other() -> None:
    cloud, _ = merged(row(10.0, 1), row(10.4, 2), deviation=0.3)
    np.testing.assert_allclose(inner(cloud)["z"], 10.2, atol=1e-5)


def test_far_apart_they_are_two_surfaces() -> None:
    cloud, contradicted = merged(row(10.0, 1), row(12.0, 2))
    assert len(cloud) == 200
    assert contradicted == {1: 0, 2: 0}


def test_planes_that_are_not_quite_one_may_slope() -> None:
    # At 45 degrees 0.2 mm further are 0.2 mm higher; the mean lies on the slope.
    cloud, contradicted = merged(row(10.0, 1, 0.01), row(10.2, 2, 0.01, x=0.2))
    np.testing.assert_allclose(coordinates(inner(cloud))[:, [0, 2]] - [0.1, 10.1], 0.0, atol=1e-5)
    assert contradicted == {1: 0, 2: 0}


def test_unsupported_points_count_only_where_nothing_else_is() -> None:
    cloud, _ = merged(row(10.0, 1), row(10.05, 2, supported=False, y=Y + 15))
    at = cloud["y"]
    np.testing.assert_allclose(cloud["z"][(at > 16) & (at < 29)], 10.0, atol=1e-5)
    np.testing.assert_allclose(cloud["z"][at > 31], 10.05, atol=1e-5)
    np.testing.assert_allclose(cloud["sigma"][at > 31], 0.02)
    assert not cloud["supported"][at > 31].any()


def test_an_edge_stays_sharp() -> None:
    # Both see the corner of a block at (15, 10), but the points of the second stand between those of the first.
    def corner(shift: float) -> tuple[np.ndarray, np.ndarray]:
        along = np.arange(100) * 0.3 + shift
        return np.minimum(along, 15.0), 10.0 - np.maximum(along - 15.0, 0.0)

    (y, z), (other_y, other_z) = corner(0.0), corner(0.15)
    cloud, _ = merged(row(z, 1, y=y), row(other_z, 2, y=other_y))
    away = np.minimum(np.abs(cloud["z"] - 10.0) + np.maximum(cloud["y"] - 15.0, 0), np.abs(cloud["y"] - 15.0))
    assert away.max() < 0.06  # what a straight line between two points cuts off a corner
    assert np.hypot(cloud["y"] - 15.0, cloud["z"] - 10.0).min() < 0.1


@pytest.mark.parametrize("spacing", [0.4, 1.0])
def test_points_are_thinned_out_but_leave_no_gaps(spacing: float) -> None:
    cloud, _ = merged(row(10.0, 1, y=Y), row(10.02, 2, y=Y + 0.1), row(10.0, 2, x=2.0), spacing_mm=spacing)
    for x in (0.0, 2.0):
        steps = np.diff(cloud["y"][cloud["x"] == x])
        assert steps.min() >= spacing - 1e-6
        assert steps.max() <= 2 * spacing + 0.3


def test_of_points_that_are_too_near_the_surest_stays() -> None:
    points = make_points(np.array([[0, 0, 0.0], [0, 0.1, 0], [0, 0.2, 0]]), 1, sigma=np.array([0.3, 0.1, 0.2]))
    cloud, _ = merged(points, spacing_mm=0.5)
    np.testing.assert_allclose(coordinates(cloud), [[0, 0.1, 0]], atol=1e-6)

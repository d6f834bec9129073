from collections.abc import Callable

import numpy as np

from footscan.cloud.outliers.off_surface import is_off_shared_surface, is_off_surface
from footscan.cloud.points import make_points

Film = Callable[..., tuple[np.ndarray, np.ndarray]]


def lifted(points: np.ndarray, camera: int, frame: int, by_mm: float, part: float = 0.2) -> np.ndarray:
    """A copy in which a piece in the middle of one stripe lies farther from the axis of the body, by `by_mm`."""
    own = np.flatnonzero((points["camera"] == camera) & (points["frame"] == frame))
    middle = own[round((0.5 - part / 2) * len(own)) : round((0.5 + part / 2) * len(own))]
    moved = points.copy()
    radius = np.hypot(moved["y"][middle], moved["z"][middle] - moved["z"].mean())
    moved["y"][middle] *= 1 + by_mm / radius
    moved["z"][middle] += (moved["z"][middle] - moved["z"].mean()) * by_mm / radius
    return moved


def test_a_piece_before_the_skin_is_off(ellipsoid: Film) -> None:
    clean, _ = ellipsoid()
    points = lifted(clean, camera=1, frame=30, by_mm=2.5)
    moved = points != clean
    off = is_off_surface(points)
    assert off[moved].mean() > 0.8
    assert off[~moved].mean() < 0.002


def test_nothing_is_off_a_whole_body(ellipsoid: Film) -> None:
    for more in ({}, {"step": 0.5}, {"step": 4.0}, {"offsets": {1: 0.5, 4: 0.5}}):
        clean, _ = ellipsoid(**more)
        assert not is_off_surface(clean).any()


def test_the_order_of_points_does_not_matter(ellipsoid: Film) -> None:
    clean, _ = ellipsoid()
    points = lifted(clean, camera=3, frame=25, by_mm=2.0)
    order = np.random.default_rng(2).permutation(len(points))
    np.testing.assert_array_equal(is_off_surface(points[order]), is_off_surface(points)[order])


def test_few_points_are_never_off() -> None:
    assert not is_off_surface(make_points(np.zeros((0, 3)), camera=1)).any()
    assert not is_off_surface(make_points(np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 0.0]]), camera=1)).any()


def test_what_one_camera_alone_saw_is_compared_with_what_several_saw(ellipsoid: Film) -> None:
    cloud, _ = ellipsoid()
    cloud["cameras"] = 3
    alone = np.flatnonzero((cloud["camera"] == 1) & (cloud["frame"] % 5 == 0))
    cloud["cameras"][alone] = 1
    assert not is_off_shared_surface(cloud).any()
    points = lifted(cloud, camera=1, frame=30, by_mm=1.5)
    moved = points != cloud
    off = is_off_shared_surface(points)
    assert off[moved].mean() > 0.8
    assert not off[~moved].any()
    points["cameras"] = 2
    assert not is_off_shared_surface(points).any()

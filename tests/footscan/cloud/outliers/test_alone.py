from collections.abc import Callable

import numpy as np
import pytest

from footscan.cloud.outliers.alone import is_off_alone
from footscan.cloud.points import make_points

Film = Callable[..., tuple[np.ndarray, np.ndarray]]


def fused(film: Film, **options: object) -> np.ndarray:
    """The ellipsoid's cloud; every fifth stripe of camera 1 was seen by it alone."""
    cloud, _ = film(**options)
    cloud["cameras"] = 3
    cloud["cameras"][(cloud["camera"] == 1) & (cloud["frame"] % 5 == 0)] = 1
    return cloud


def with_mirror(cloud: np.ndarray, above_mm: float, frames: range, cameras: int = 1) -> np.ndarray:
    """The cloud, and arcs above it that go on for some frames."""
    angle = np.linspace(0.3, 0.8, 20)
    parts = []
    for frame in frames:
        skin = cloud[(cloud["frame"] == frame) & (cloud["camera"] == 1)]
        middle = skin["z"].mean()
        radius = np.hypot(skin["y"], skin["z"] - middle).max() + above_mm
        arc = np.column_stack([np.full(20, skin["x"][0]), radius * np.cos(angle), middle + radius * np.sin(angle)])
        points = make_points(arc, camera=5, frame=frame)
        points["cameras"] = cameras
        parts.append(points)
    return np.concatenate([cloud, *parts])


@pytest.mark.parametrize("step", [1.0, 3.0, 6.0])
def test_skin_that_one_camera_alone_saw_stays(ellipsoid: Film, step: float) -> None:
    cloud = fused(ellipsoid, step=step)
    inner = np.abs(cloud["x"] - 60) < 40  # the ends of the body curve more than a step tells
    assert not is_off_alone(cloud)[inner].any()


@pytest.mark.parametrize("frames", [range(20, 21), range(20, 25), range(15, 30)])
def test_what_floats_beside_the_skin_is_off(ellipsoid: Film, frames: range) -> None:
    cloud = fused(ellipsoid)
    off = is_off_alone(with_mirror(cloud, 6.0, frames))
    assert off[len(cloud) :].all()
    assert not off[: len(cloud)][np.abs(cloud["x"] - 60) < 40].any()


def test_what_several_cameras_saw_stays(ellipsoid: Film) -> None:
    cloud = fused(ellipsoid)
    assert not is_off_alone(with_mirror(cloud, 6.0, range(20, 25), cameras=2))[len(cloud) :].any()


def test_a_side_that_one_camera_alone_saw_stays(ellipsoid: Film) -> None:
    cloud = fused(ellipsoid)
    cloud["cameras"] = np.where(cloud["y"] > 0, 1, 2)
    assert is_off_alone(cloud).mean() < 0.005


def test_clouds_without_agreement_stay(ellipsoid: Film) -> None:
    cloud = fused(ellipsoid)
    cloud["cameras"] = 1
    assert not is_off_alone(cloud).any()
    assert not is_off_alone(cloud[:0]).any()


def test_a_piece_of_stripe_that_joins_what_several_cameras_saw_may_be_farther_off() -> None:
    x, y = (part.ravel() for part in np.mgrid[0:30:3, 0:12:0.5])
    alone = (x == 12) & (y > 6)
    depth = np.where(alone, -1.5, 0.0)
    joined = make_points(np.column_stack([x, y, depth]), camera=1, frame=(x / 3).astype(int), source=np.arange(len(x)))
    joined["z"][alone & (y == 6.5)] = -0.5  # the way down
    joined["cameras"] = np.where(alone, 1, 3)
    apart = joined[~((x == 12) & (y > 4) & (y < 8))]
    assert not is_off_alone(joined).any()
    assert np.array_equal(is_off_alone(apart), apart["cameras"] == 1)
    deeper = joined.copy()
    deeper["z"][alone & (y > 6.5)] = -2.5
    assert is_off_alone(deeper).any()

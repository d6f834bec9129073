from collections.abc import Callable

import numpy as np

from footscan.cloud.outliers.glass import is_below_sole, is_plate
from footscan.cloud.points import make_points
from footscan.cloud.views import View

NOWHERE = np.empty((0, 2))
VIEWS = {
    1: View(np.array([200.0, 200.0, 150.0]), NOWHERE),
    3: View(np.array([200.0, -200.0, 150.0]), NOWHERE),
    5: View(np.array([200.0, 100.0, -150.0]), NOWHERE),
}


def planes(y: np.ndarray, z: np.ndarray, camera: int, frames: range) -> np.ndarray:
    parts = [
        make_points(np.column_stack([np.full(len(y), 2.0 * f), y, z]), camera=camera, frame=f, source=np.arange(len(y)))
        for f in frames
    ]
    return np.concatenate(parts)


def sides(frames: range = range(20, 40)) -> np.ndarray:
    z = np.arange(0.0, 30.0)
    return np.concatenate([planes(np.full(30, s * 25.0), z, camera, frames) for camera, s in ((1, 1), (3, -1))])


def flat(low: float, high: float, frames: range, z: float = 0.0) -> np.ndarray:
    y = np.arange(low, high, 0.5)
    return planes(y, np.full(len(y), z), 5, frames)


def test_below_the_glass() -> None:
    points = np.concatenate([sides(), flat(-20, 20, range(20, 40), -0.4), flat(-20, 20, range(20, 40), -0.6)])
    np.testing.assert_array_equal(is_plate(points, VIEWS, 0.5), points["z"] < -0.5)


def test_the_sole_between_the_sides_stays() -> None:
    points = np.concatenate([sides(), flat(-25, 25, range(20, 40))])
    assert not is_plate(points, VIEWS, 0.5).any()


def test_the_glass_beside_before_and_behind() -> None:
    glass = np.concatenate([flat(31, 60, range(20, 40)), flat(-60, 60, range(10, 17)), flat(-60, 60, range(43, 50))])
    points = np.concatenate([sides(), flat(-25, 25, range(20, 40)), glass])
    dropped = is_plate(points, VIEWS, 0.5)
    assert dropped[-len(glass) :].all()
    assert not dropped[: -len(glass)].any()


def test_planes_without_sides_have_those_next_to_them() -> None:
    points = np.concatenate([sides(range(20, 28)), sides(range(34, 40)), flat(-25, 25, range(20, 40))])
    assert not is_plate(points, VIEWS, 0.5).any()


def test_without_cameras_above_on_both_sides_nothing_is_known_of_the_glass() -> None:
    points = np.concatenate([sides(), flat(31, 60, range(20, 40))])
    assert not is_plate(points[points["camera"] != 3], VIEWS, 0.5).any()
    assert not is_plate(points, {}, 0.5).any()


def test_a_mark_below_a_sole_above_the_glass(
    ellipsoid: Callable[..., tuple[np.ndarray, np.ndarray]], views: dict[int, View]
) -> None:
    """The ellipsoid touches the glass in its middle; towards its ends it is higher."""
    clean, _ = ellipsoid()
    contact = clean[(clean["camera"] > 4) & (np.abs(clean["x"] - 60.0) < 8.0) & (np.abs(clean["y"]) < 4.0)]
    assert contact["z"].max() < 1.0
    mark = contact.copy()
    mark["x"] -= 30.0
    mark["plane"] -= 30.0
    mark["z"] = 0.0
    points = np.concatenate([clean, mark])
    below = is_below_sole(points, views, 0.5)
    assert below[len(clean) :].all()
    assert not below[: len(clean)].any()
    one = points[points["camera"] <= 5]  # a single camera below may see a reflection
    assert not is_below_sole(one, views, 0.5).any()

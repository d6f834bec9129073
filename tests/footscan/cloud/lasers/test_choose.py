"""A sole that cameras below see in two laser planes: each stripe point is assigned to its laser, or dropped."""

import numpy as np
import pytest

from footscan.cloud.lasers.choose import choose_lasers
from footscan.cloud.outliers.remove import NO_POINT, REASONS, remove_outliers
from footscan.cloud.points import make_points
from schemas.calibration import view_number
from schemas.parameters.outliers import OutlierParameters

APART_MM, STEP_MM, FRAMES = 12.0, 2.0, 40
CAMERAS = {
    5: np.array([170.0, 90.0, -160.0]),
    6: np.array([-170.0, 90.0, -160.0]),
    7: np.array([170.0, -90.0, -160.0]),
    8: np.array([-170.0, -90.0, -160.0]),
}
"""Places relative to the head, mm."""
Y = np.arange(-30.0, 30.0, 0.3)


def sole(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 4.0 + 8.0 * np.sin(x / 25.0) * np.cos(y / 30.0)


def candidates(cameras: dict[int, np.ndarray], lasers: tuple[int, ...] = (1, 2)) -> tuple[np.ndarray, np.ndarray]:
    """The places of all stripe points by both maps, (N,), and the laser that drew each."""
    random = np.random.default_rng(4)
    parts, drew = [], []
    for camera, eye in cameras.items():
        sources = 0
        for frame in range(FRAMES):
            for laser in lasers:
                head = STEP_MM * frame
                x = np.full(len(Y), head + APART_MM * (laser - 1))
                there = np.column_stack([x, Y, sole(x, Y)]) + random.normal(0.0, [0.0, 0.03, 0.03], (len(Y), 3))
                place = eye + np.array([head, 0.0, 0.0])
                for mapped in (1, 2):
                    plane = head + APART_MM * (mapped - 1)
                    share = (plane - there[:, 0]) / (place[0] - there[:, 0])
                    seen = there + share[:, None] * (place - there)
                    source = np.arange(sources, sources + len(Y))
                    parts.append(make_points(seen, view_number(camera, mapped), frame, source))
                    drew.append(np.full(len(Y), laser))
                sources += len(Y)
    return np.concatenate(parts), np.concatenate(drew)


@pytest.mark.parametrize(
    ("cameras", "share"),
    [((5, 6, 7, 8), 0.99), ((5, 6), 0.99), ((6, 8), 0.99), ((7,), 0.85)],  # the ends of the travel: one laser alone
)
def test_each_point_is_of_the_laser_that_drew_it(cameras: tuple[int, ...], share: float) -> None:
    points, drew = candidates({camera: CAMERAS[camera] for camera in cameras})
    choice = choose_lasers(points)
    mapped = np.where(points["camera"] > 64, 2, 1)
    real = ~choice.other & ~choice.unassigned
    assert (mapped[real] == drew[real]).mean() > 0.999
    assert real.sum() > share * len(points) / 2
    assert real.sum() + choice.unassigned.sum() == len(points) / 2


def test_the_order_of_points_does_not_matter() -> None:
    points, _ = candidates({camera: CAMERAS[camera] for camera in (5, 8)})
    order = np.random.default_rng(1).permutation(len(points))
    choice, mixed = choose_lasers(points), choose_lasers(points[order])
    np.testing.assert_array_equal(choice.other[order], mixed.other)
    np.testing.assert_array_equal(choice.unassigned[order], mixed.unassigned)


def test_one_camera_and_one_laser_say_nothing_of_which_it_is() -> None:
    points, _ = candidates({5: CAMERAS[5]}, lasers=(2,))
    choice = choose_lasers(points)
    assert choice.unassigned.sum() == len(points) / 2
    kept, removed = remove_outliers(points, {}, OutlierParameters())
    assert len(kept) == 0
    assert removed.counts == {5: {**dict.fromkeys(REASONS, 0), "laser": len(points) // 2}}
    assert (removed.codes == NO_POINT).sum() == len(points) / 2


def test_cameras_that_see_one_laser_are_left_alone() -> None:
    points, _ = candidates({5: CAMERAS[5]})
    alone = points[points["camera"] == 5]
    choice = choose_lasers(alone)
    assert not choice.other.any()
    assert not choice.unassigned.any()
    assert not choose_lasers(points[:0]).other.any()

import numpy as np

from footscan.cloud.outliers.clutter import is_island, is_static
from footscan.cloud.points import make_points


def film(y: float, z: float, frames: range, count: int = 20, camera: int = 1) -> np.ndarray:
    """A short level line at one place in each of some frames, 2 mm apart."""
    parts = [
        make_points(
            np.column_stack([np.full(count, 2.0 * f), y + 0.3 * np.arange(count), np.full(count, z)]),
            camera=camera, frame=f, source=np.arange(count),
        )
        for f in frames
    ]  # fmt: skip
    return np.concatenate(parts)


def test_what_stays_from_before_the_foot_to_beyond_it() -> None:
    foot, clutter = film(0.0, 10.0, range(30, 70), 60), film(40.0, 50.0, range(100))
    static = is_static(np.concatenate([foot, clutter]), 0.7)
    assert not static[: len(foot)].any()
    assert static[len(foot) :].all()


def test_the_foot_may_stand_where_clutter_was_hidden() -> None:
    foot = film(0.0, 10.0, range(30, 70), 60)
    clutter = np.concatenate([film(5.0, 10.0, range(25)), film(5.0, 10.0, range(75, 100))])
    static = is_static(np.concatenate([foot, clutter]), 0.7)
    assert not static[: len(foot)].any()
    assert static[len(foot) :].all()


def test_frames_may_lack_it_now_and_then() -> None:
    foot = film(0.0, 10.0, range(30, 70), 60)
    clutter = film(40.0, 50.0, range(100))
    clutter = clutter[clutter["frame"] % 5 != 2]
    assert is_static(np.concatenate([foot, clutter]), 0.7)[len(foot) :].all()


def test_a_prism_is_no_clutter() -> None:
    assert not is_static(film(0.0, 10.0, range(100), 60), 0.7).any()


def test_what_begins_with_the_foot_is_no_clutter() -> None:
    foot, ledge = film(0.0, 10.0, range(30, 70), 60), film(40.0, 50.0, range(30, 70))
    assert not is_static(np.concatenate([foot, ledge]), 0.7).any()


def test_cameras_are_looked_at_one_by_one_and_points_in_any_order() -> None:
    foot, clutter = film(0.0, 10.0, range(30, 70), 60), film(40.0, 50.0, range(100))
    other = film(40.0, 50.0, range(30, 70), camera=2)
    points = np.concatenate([foot, clutter, other])
    static = is_static(points, 0.7)
    assert not static[points["camera"] == 2].any()
    order = np.random.default_rng(2).permutation(len(points))
    np.testing.assert_array_equal(is_static(points[order], 0.7), static[order])


def test_islands() -> None:
    large, near, far = film(0.0, 10.0, range(40), 60), film(20.0, 10.0, range(10), 4), film(40.0, 40.0, range(5), 4)
    island = is_island(np.concatenate([large, near, far]), 2.5, 0.05)
    assert not island[: len(large) + len(near)].any()
    assert island[len(large) + len(near) :].all()


def test_one_plane_has_no_islands() -> None:
    assert not is_island(np.concatenate([film(0.0, 10.0, range(1), 60), film(50.0, 10.0, range(1), 2)]), 2.5, 0.1).any()

import numpy as np

from footscan.cloud.outliers.segments import segments_of
from footscan.cloud.points import make_points


def along(y: list[float], camera: int = 1, frame: int = 0) -> np.ndarray:
    xyz = np.column_stack([np.zeros(len(y)), y, np.zeros(len(y))])
    return make_points(xyz, camera=camera, frame=frame, source=np.arange(len(y)))


def test_a_gap_ends_a_segment() -> None:
    assert segments_of(along([0, 1, 2, 4, 5]), 1.5, 100.0)[0].tolist() == [0, 0, 0, 1, 1]


def test_frames_and_cameras_are_apart() -> None:
    points = np.concatenate([along([0, 1]), along([1, 2], frame=1), along([2, 3], camera=2, frame=1)])
    assert segments_of(points, 1.5, 100.0)[0].tolist() == [0, 0, 1, 1, 2, 2]


def test_a_long_one_is_cut_into_even_parts() -> None:
    assert segments_of(along([0, 1, 2, 3, 4, 5, 6]), 1.5, 4.0)[0].tolist() == [0, 0, 0, 1, 1, 1, 1]
    assert segments_of(along([0, 1, 2, 3, 4]), 1.5, 4.0)[0].tolist() == [0, 0, 0, 0, 0]


def test_points_in_any_order() -> None:
    points = np.concatenate([along([0, 1, 2, 4, 5]), along([3, 4], frame=1), along([9], camera=3)])
    order = np.random.default_rng(0).permutation(len(points))
    np.testing.assert_array_equal(segments_of(points[order], 1.5, 100.0)[0], segments_of(points, 1.5, 100.0)[0][order])


def test_one_point_and_doubled_points() -> None:
    assert segments_of(along([7]), 1.5, 10.0)[0].tolist() == [0]
    assert segments_of(along([7, 7, 7]), 1.5, 10.0)[0].tolist() == [0, 0, 0]
    assert segments_of(along([]), 1.5, 10.0)[0].tolist() == []


def test_places_count_from_both_ends_of_a_piece() -> None:
    assert segments_of(along([0, 1, 2, 3, 4, 6, 7]), 1.5, 2.0)[1].tolist() == [0, 1, 2, 1, 0, 0, 0]

import numpy as np
import pytest

from footscan.cloud.fusion.stripes import boxes, meet, sort_stripes
from footscan.cloud.points import UNKNOWN_SIGMA_MM, make_points


def row(x: float, y: np.ndarray, z: np.ndarray, camera: int, frame: int = 0) -> np.ndarray:
    xyz = np.column_stack([np.full(len(y), x), y, z])
    return make_points(xyz, camera=camera, frame=frame, source=np.arange(len(y)), sigma=0.02)


def test_sorted_by_plane_camera_frame_and_source() -> None:
    y = np.arange(5) * 0.3
    first = np.concatenate([row(4.0, y, y, 7, 2), row(0.1, y, y, 7, 0)])
    second = row(0.0, y, y, 2)
    stripes = sort_stripes([first, second])
    assert stripes.cameras.tolist() == [2, 7]
    # 0.1 and 0 mm are one plane.
    assert stripes.plane.tolist() == [0] * 10 + [1] * 5
    assert stripes.points["camera"].tolist() == [2] * 5 + [7] * 10
    assert stripes.starts.tolist() == [0, 5, 10, 10, 15]
    assert sort_stripes([second, first]).points.tobytes() == stripes.points.tobytes()


def test_uneven_planes_do_not_run_into_each_other() -> None:
    points = make_points(np.column_stack([np.arange(11) * 0.1, np.zeros((11, 2))]), camera=1)
    # 0.25 mm: three at a time.
    assert sort_stripes([points]).plane.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3]


def test_what_is_not_finite_is_left_out() -> None:
    points = make_points(
        np.array([[0, 0, 0], [np.nan, 0, 0], [0, np.inf, 0]]), camera=1, sigma=np.array([np.nan, 1, 1])
    )
    stripes = sort_stripes([points])
    assert stripes.yz.tolist() == [[0.0, 0.0]]
    assert stripes.sigma.tolist() == [UNKNOWN_SIGMA_MM]


def test_normals_and_corners_by_hand() -> None:
    y = np.concatenate([np.arange(20) * 0.3, np.full(20, 6.0)])
    z = np.concatenate([np.full(20, 5.0), 5.0 - np.arange(20) * 0.3])
    stripes = sort_stripes([row(0.0, y, z, 1)])
    np.testing.assert_allclose(np.abs(stripes.normals[[5, 35]]), [[0, 1], [1, 0]], atol=1e-6)
    assert stripes.bent[[5, 35]].tolist() == [False, False]
    assert stripes.bent[19] or stripes.bent[20]


def test_a_point_alone_has_no_normal() -> None:
    stripes = sort_stripes([row(0.0, np.array([0.0, 5.0]), np.zeros(2), 1)])
    assert not stripes.normals.any()
    assert not stripes.linked.any()


@pytest.mark.parametrize(("reach", "expected"), [(1.0, (12, 0.5, 0.7)), (0.6, (-1, 0.0, 0.6))])
def test_where_a_normal_meets_another_stripe(reach: float, expected: tuple[int, float, float]) -> None:
    y = np.arange(40) * 0.25
    stripes = sort_stripes([row(0.0, y, np.full(40, 10.0), 1), row(0.0, y + 0.125, np.full(40, 10.7), 2)])
    sign = np.sign(stripes.normals[13, 1])
    # The point 13 of the first stripe is at y = 3.25, between 3.125 and 3.375 of the second one.
    found = meet(13, 40, 80, reach, stripes.yz, stripes.normals, stripes.linked, boxes(stripes.yz))
    if expected[0] < 0:
        assert found[0] == -1
    else:
        assert found == pytest.approx((expected[0] + 40, expected[1], sign * expected[2]), abs=1e-5)


def test_a_surface_that_runs_across_is_another_one() -> None:
    y = np.arange(40) * 0.25
    stripes = sort_stripes([row(0.0, y, np.full(40, 10.0), 1), row(0.0, np.full(40, 5.0), y + 6.0, 2)])
    found = meet(20, 40, 80, 3.0, stripes.yz, stripes.normals, stripes.linked, boxes(stripes.yz))
    assert found[0] == -1


def test_nothing() -> None:
    stripes = sort_stripes([])
    assert len(stripes.points) == 0
    assert boxes(stripes.yz).shape == (0, 4)

import numpy as np
import pytest
from pydantic import ValidationError

from footscan.cloud.outliers import remove_outliers
from footscan.cloud.points import coordinates, make_points
from schemas.parameters.outliers import OutlierParameters


def sheet(z: float = 10.0) -> np.ndarray:
    """A plane of 30 stripes 2 mm apart, 80 points 0.5 mm apart in each."""
    x, y = np.meshgrid(np.arange(30) * 2.0, np.arange(80) * 0.5 - 20, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])


def filmed(points: np.ndarray, camera: int, **more: object) -> np.ndarray:
    """A cloud of one camera whose frame k stands at X = 2 k mm."""
    frame = np.nan_to_num(np.round(points[:, 0] / 2)).astype(int)
    return make_points(points, camera=camera, frame=frame, **more)


def cleaned(extra: list[list[float]], **more: object) -> tuple[np.ndarray, dict[str, int]]:
    cloud = np.concatenate([filmed(sheet(), camera=1), filmed(np.array(extra), camera=5, **more)])
    kept, removed = remove_outliers(cloud, OutlierParameters())
    assert removed[1] == dict.fromkeys(removed[1], 0)
    np.testing.assert_array_equal(coordinates(kept), sheet())
    return kept, removed[5]


def test_a_clean_cloud_stays_as_it_is() -> None:
    cloud = filmed(sheet(), camera=1)
    kept, removed = remove_outliers(cloud, OutlierParameters())
    assert kept.tobytes() == cloud.tobytes()
    assert removed == {1: {"volume": 0, "unsupported": 0, "distant": 0, "off_surface": 0, "island": 0}}


def test_points_outside_the_control_volume() -> None:
    _, removed = cleaned([[10.0, 90.0, 10.0], [10.0, 0.0, -4.0], [10.0, 0.0, 200.0], [np.nan, 0.0, 10.0]])
    assert removed == {"volume": 4, "unsupported": 0, "distant": 0, "off_surface": 0, "island": 0}


def test_unsupported_points() -> None:
    _, removed = cleaned([[10.0, 0.1, 10.0], [12.0, 0.1, 10.0]], supported=False)
    assert removed["unsupported"] == 2


def test_unsupported_points_may_stay() -> None:
    cloud = filmed(sheet(), camera=1, supported=False)
    kept, _ = remove_outliers(cloud, OutlierParameters(drop_unsupported=False))
    assert len(kept) == len(cloud)


def test_a_lonely_point_is_distant() -> None:
    _, removed = cleaned([[30.0, 0.0, 40.0]])
    assert removed["distant"] == 1


def test_a_point_close_above_the_sheet_is_off_the_surface() -> None:
    _, removed = cleaned([[30.0, 0.0, 11.2]])
    assert removed["off_surface"] == 1


def test_a_glint_that_is_dense_within_its_plane_is_dropped() -> None:
    glint = [[30.0, 0.5 * k, 60.0] for k in range(20)]
    _, removed = cleaned(glint)
    assert sum(removed.values()) == 20


def test_a_small_island_is_dropped() -> None:
    patch = [[x, y, 60.0] for x in (20.0, 22.0, 24.0, 26.0) for y in np.arange(9) * 0.5]
    _, removed = cleaned(patch)
    assert sum(removed.values()) == 36
    assert removed["island"] >= 1


def test_two_large_parts_stay() -> None:
    cloud = filmed(np.concatenate([sheet(10.0), sheet(60.0)]), camera=1)
    assert len(remove_outliers(cloud, OutlierParameters())[0]) == len(cloud)


@pytest.mark.parametrize("count", [0, 1, 5])
def test_few_points(count: int) -> None:
    cloud = make_points(np.zeros((count, 3)), camera=1)
    assert len(remove_outliers(cloud, OutlierParameters())[0]) == count


def test_ranges_are_ordered() -> None:
    with pytest.raises(ValidationError, match="lower limit first"):
        OutlierParameters(y_mm=(5.0, -5.0))

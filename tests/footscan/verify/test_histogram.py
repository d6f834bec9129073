import numpy as np
import pytest

from footscan.verify.histogram import histogram


def test_eight_classes_by_hand() -> None:
    # 0 to 8 mm: classes of 1 mm; the greatest belongs to the last.
    result = histogram(np.array([0, 0.5, 1, 1, 2.5, 7, 7.9, 8], np.float32), 8, signed=False)
    assert result.edges_mm == pytest.approx(range(9))
    assert result.counts == [2, 2, 1, 0, 0, 0, 0, 3]
    assert result.shares == pytest.approx([0.25, 0.25, 0.125, 0, 0, 0, 0, 0.375])
    assert not result.signed


def test_signed_classes_run_from_the_farthest_inside_to_the_farthest_outside() -> None:
    result = histogram(np.array([-0.6, -0.1, 0.1, 0.8], np.float32), 2, signed=True)
    assert result.edges_mm == pytest.approx([-0.6, 0.1, 0.8], abs=1e-6)
    assert result.signed


@pytest.mark.parametrize("classes", [1, 8, 70, 1000])
def test_every_distance_is_in_one_class(classes: int) -> None:
    distances = np.random.default_rng(0).normal(0, 1, 100_003).astype(np.float32)
    result = histogram(distances, classes, signed=True)
    assert len(result.counts) == len(result.shares) == len(result.edges_mm) - 1 == classes
    assert sum(result.counts) == len(distances)
    assert sum(result.shares) == pytest.approx(1)
    assert np.all(np.diff(result.edges_mm) > 0)
    assert result.counts == np.histogram(distances.astype(np.float64), result.edges_mm)[0].tolist()


@pytest.mark.parametrize("value", [0.0, 0.25, -3.0, 1e6])
def test_distances_that_are_all_the_same_are_one_class(value: float) -> None:
    result = histogram(np.full(10, value, np.float32), 70, signed=True)
    assert result.counts == [10] + [0] * 69
    assert result.edges_mm[0] == value
    assert np.all(np.diff(result.edges_mm) > 0)

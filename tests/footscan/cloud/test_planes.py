import numpy as np
import pytest

from footscan.cloud.planes import SUMS, add_point, plane_normal


def summed(points: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    sums = np.zeros(SUMS)
    for point, weight in zip(points, np.ones(len(points)) if weights is None else weights, strict=True):
        add_point(sums, *point, weight)
    return sums


@pytest.mark.parametrize("seed", range(8))
def test_the_least_eigenvector_of_the_covariance(seed: int) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(0, [5.0, 1.5, 0.2], (40, 3)) @ np.linalg.qr(random.normal(size=(3, 3)))[0] + [300, -20, 50]
    weights = random.uniform(0.1, 1.0, 40)
    values, vectors = np.linalg.eigh(np.cov(points.T, aweights=weights, ddof=0))
    *normal, across, along = plane_normal(summed(points, weights))
    assert abs(np.dot(normal, vectors[:, 0])) == pytest.approx(1.0, abs=1e-8)
    assert across == pytest.approx(values[0], rel=1e-5)
    assert along == pytest.approx(values[1], rel=1e-6)


def test_an_exact_plane() -> None:
    square = np.array([[0.0, 0, 4], [1, 0, 4], [0, 1, 4], [1, 1, 4]])
    *normal, across, along = plane_normal(summed(square))
    np.testing.assert_allclose(np.abs(normal), [0, 0, 1], atol=1e-12)
    assert across == pytest.approx(0.0, abs=1e-12)
    assert along == pytest.approx(0.25)


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.full((1, 3), 7.0), np.full((5, 3), 7.0)])
def test_no_plane(points: np.ndarray) -> None:
    assert plane_normal(summed(points)) == (0.0, 0.0, 0.0, 0.0, 0.0)


def test_a_line_has_no_breadth() -> None:
    *normal, across, along = plane_normal(summed(np.outer(np.arange(5.0), [1.0, 2.0, 2.0])))
    assert across == pytest.approx(0.0, abs=1e-9)
    assert along == pytest.approx(0.0, abs=1e-9)
    assert np.isfinite(normal).all()

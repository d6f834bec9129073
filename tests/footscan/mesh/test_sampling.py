import numpy as np
import pytest

from footscan.mesh.sampling import sample_surface, surface_area

VERTICES = np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 0], [10, 0, 0], [10, 2, 0], [12, 0, 0]])
FACES = np.array([[0, 1, 2], [3, 4, 5]])


def test_area() -> None:
    assert surface_area(VERTICES, FACES) == 6.0 + 2.0


def test_triangles_get_points_by_their_area() -> None:
    points = sample_surface(VERTICES, FACES, 8000)
    assert np.sum(points[:, 0] < 5) == 6000
    first = points[points[:, 0] < 5]
    np.testing.assert_allclose(first.mean(axis=0), [4 / 3, 1.0, 0.0], atol=0.03)
    assert (first[:, 0] / 4 + first[:, 1] / 3).max() <= 1 + 1e-12


def test_the_same_at_every_call() -> None:
    assert sample_surface(VERTICES, FACES, 100).tobytes() == sample_surface(VERTICES, FACES, 100).tobytes()


@pytest.mark.parametrize("count", [0, 1])
def test_few_points(count: int) -> None:
    assert sample_surface(VERTICES, FACES, count).shape == (count, 3)

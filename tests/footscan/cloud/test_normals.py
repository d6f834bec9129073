import numpy as np
import pytest

from footscan.cloud.normals import estimate_normals
from footscan.cloud.points import make_points
from schemas.parameters.normals import NormalParameters


def filmed(points: np.ndarray, camera: int | np.ndarray) -> np.ndarray:
    """A cloud whose frame k stands at X = 2 k mm."""
    return make_points(points, camera=camera, frame=np.round(points[:, 0] / 2).astype(int))


def cylinder() -> tuple[np.ndarray, np.ndarray]:
    """Stripes 2 mm apart around a cylinder of 30 mm radius along X, and where their points look outward."""
    x, angle = np.meshgrid(np.arange(60) * 2.0, np.linspace(0, 2 * np.pi, 300, endpoint=False), indexing="ij")
    outward = np.column_stack([np.zeros(x.size), np.cos(angle.ravel()), np.sin(angle.ravel())])
    return np.column_stack([x.ravel(), np.zeros(x.size), np.full(x.size, 50.0)]) + 30 * outward, outward


def seen_by(outward: np.ndarray) -> np.ndarray:
    """The sole is seen by cameras 5 and 7, all else by 1 and 3, each on its side."""
    below, left = outward[:, 2] < -0.5, outward[:, 1] > 0
    return np.where(below, np.where(left, 5, 7), np.where(left, 1, 3))


def test_normals_of_a_cylinder_point_outward() -> None:
    points, outward = cylinder()
    normals = estimate_normals(filmed(points, camera=seen_by(outward)), NormalParameters())
    assert normals.dtype == np.float32
    # A plane fit over part of a cylinder, symmetric but at its two ends: exact but for the points' unequal spacing.
    assert np.sum(normals * outward, axis=1).min() > np.cos(np.deg2rad(3.0))
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)


@pytest.mark.parametrize(("x", "expected"), [(0.0, -1.0), (200.0, 1.0)])
def test_ends_look_along_the_travel(x: float, expected: float) -> None:
    y, z = np.meshgrid(np.arange(30) * 0.5 - 7.25, np.arange(30) * 0.5 + 20, indexing="ij")
    end = np.column_stack([np.full(y.size, x), y.ravel(), z.ravel()])
    points, _ = cylinder()
    cloud = filmed(np.concatenate([end, points + np.array([40.0, 0.0, 200.0])]), camera=1)
    normals = estimate_normals(cloud, NormalParameters())[: len(end)]
    np.testing.assert_allclose(normals[:, 0], expected, atol=1e-3)


def test_the_same_at_every_call() -> None:
    points, outward = cylinder()
    cloud = filmed(points, camera=seen_by(outward))
    first = estimate_normals(cloud, NormalParameters())
    assert first.tobytes() == estimate_normals(cloud, NormalParameters()).tobytes()


def test_no_points() -> None:
    assert estimate_normals(make_points(np.zeros((0, 3)), camera=1), NormalParameters()).shape == (0, 3)

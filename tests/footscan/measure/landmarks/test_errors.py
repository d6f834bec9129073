import numpy as np
import pytest

from footscan.measure.landmarks.errors import saddle_gradient, summit_gradient
from footscan.measure.landmarks.extreme import Cap

UP = np.array([0.0, 0.0, 1.0])
SUMMIT = np.array([3.0, -2.0, 20.0])


def fitted(noise: float = 0.1) -> Cap:
    """A cap of 1 mm: its half axes are 6.3 and 8.9 mm."""
    return Cap(np.diag([1 / np.sqrt(40), 1 / np.sqrt(80)]), 1.0, noise)


def cap(step: float = 1.5) -> tuple[np.ndarray, np.ndarray]:
    """A summit at (3, -2, 20), radius 20 mm along X and 40 mm along Y, and its normals."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(-20, 20, step), np.arange(-20, 20, step)))
    vertices = np.column_stack([x + 3, y - 2, 20 - x**2 / 40 - y**2 / 80])
    normals = np.column_stack([x / 20, y / 40, np.ones_like(x)])
    return vertices, normals / np.linalg.norm(normals, axis=1)[:, None]


@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize("move", [(1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0), (0.5, -0.2, 0.3)])
def test_a_summit_moves_with_its_surface(noise: float, move: tuple[float, float, float]) -> None:
    vertices, normals = cap()
    gradient = summit_gradient(vertices, normals, SUMMIT, UP, fitted(noise))
    # To first order a surface that moves by m moves along its normals n by n m.
    np.testing.assert_allclose(gradient @ (normals @ np.array(move)), move, atol=0.03)


def test_noise_moves_a_flat_summit_along_more_than_across() -> None:
    vertices, normals = cap()
    gradient = summit_gradient(vertices, normals, SUMMIT, UP, fitted())
    x, y, z = np.linalg.norm(gradient, axis=1)
    assert y > x > 2 * z
    assert z < 0.5


def test_a_downward_summit_has_the_opposite_sign() -> None:
    vertices, normals = cap()
    mirror = np.array([1.0, 1.0, -1.0])
    above = summit_gradient(vertices, normals, SUMMIT, UP, fitted())
    below = summit_gradient(vertices * mirror, normals * mirror, SUMMIT * mirror, -UP, fitted())
    np.testing.assert_allclose(below, above * mirror[:, None], atol=1e-9)


def test_too_few_vertices_tell_nothing() -> None:
    vertices, normals = cap(step=15.0)
    assert not summit_gradient(vertices, normals, SUMMIT, UP, fitted()).any()


def test_the_nearest_point_of_a_crease_moves_with_its_surface() -> None:
    # Seen from the side z = 60 + (x - 60)^2 / 30 falls to the right of the corner: nearest along the diagonal.
    u, v = (grid.ravel() for grid in np.meshgrid(np.arange(-15, 15.1, 1.0), np.arange(-12, 12.1, 1.0)))
    out, along = np.array([1.0, 0.0, 1.0]) / np.sqrt(2), np.array([-1.0, 0.0, 1.0]) / np.sqrt(2)
    distance = 40 + u**2 / 30 - v**2 / 60  # a saddle: nearest along the crease, farthest across the foot
    corner = np.array([50.0, 0.0, 20.0])
    vertices = corner + distance[:, None] * out + u[:, None] * along + v[:, None] * [0.0, 1.0, 0.0]
    normals = out - (u / 15)[:, None] * along + (v / 30)[:, None] * np.array([0.0, 1.0, 0.0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    point = corner + 40 * out
    gradient = saddle_gradient(vertices, normals, point, corner, Cap(np.eye(2) / 8.0, 8.0, 0.1))
    np.testing.assert_allclose(gradient @ (normals @ out), out, atol=0.05)

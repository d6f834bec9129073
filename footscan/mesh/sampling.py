"""Points spread evenly over a surface."""

import numpy as np
from numpy.typing import NDArray


def sample_surface(vertices: NDArray[np.floating], faces: NDArray[np.integer], count: int) -> NDArray[np.float64]:
    """Returns (count, 3) points spread evenly over the area of a mesh, the same at every call.

    The vertices themselves are denser where triangles are small.

    Parameters
    ----------
    vertices : (V, 3) mm
    faces : (F, 3)
    """
    corners = np.asarray(vertices, np.float64)[faces]
    cumulative = np.cumsum(_triangle_areas(corners))
    even = (np.arange(count) + 0.5) / count * cumulative[-1]
    chosen = corners[np.minimum(np.searchsorted(cumulative, even), len(faces) - 1)]
    # Uniform over a triangle: Turk, "Generating random points in triangles", Graphics Gems 1990.
    root, along = np.random.default_rng(0).random((2, count, 1))
    root = np.sqrt(root)
    sampled: NDArray[np.float64] = (
        (1 - root) * chosen[:, 0] + root * (1 - along) * chosen[:, 1] + root * along * chosen[:, 2]
    )
    return sampled


def surface_area(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> float:
    """Area in mm² of a mesh of (V, 3) `vertices` in mm and (F, 3) `faces`.

    Examples
    --------
    >>> surface_area(np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0]]), np.array([[0, 1, 2]]))
    3.0
    """
    return float(_triangle_areas(np.asarray(vertices, np.float64)[faces]).sum())


def _triangle_areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    areas: NDArray[np.float64] = (
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    )
    return areas

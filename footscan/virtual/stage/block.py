"""The rectangular block: a body whose every measure is known."""

import numpy as np
import numpy.typing as npt


def make_block(
    size: tuple[float, float, float] = (150.0, 100.0, 50.0),
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    """A box of `size` (X, Y, Z), mm, on the floor Z = 0, from X = 0 on, centred in Y.

    Returns its vertices, shape (8, 3), mm, scanner frame, and outward triangles, shape (12, 3).

    >>> vertices, faces = make_block((2.0, 4.0, 1.0))
    >>> vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()
    ([0.0, -2.0, 0.0], [2.0, 2.0, 1.0])
    """
    corners = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=np.float64)
    vertices = (corners - (0.0, 0.5, 0.0)) * size
    # Corner k stands at x = bit 0, y = bit 1, z = bit 2; each side goes round counter-clockwise seen from outside.
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = [triangle for a, b, c, d in sides for triangle in ((a, b, c), (a, c, d))]
    return vertices, np.array(faces, dtype=np.int32)

"""A small picture of a foot from above."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from footscan.report.filled import MEASURED
from footscan.report.render import png_bytes, render_mesh
from footscan.report.surface_views import upright

WIDTH_PX, HEIGHT_PX = 192, 80
"""Twice the size at which it is shown, for screens of high resolution."""
_LONGEST_MM = 320.0
"""Length that fills the width. All feet have this scale, so that sizes compare; a longer foot is drawn smaller."""


def thumbnail(vertices: NDArray[np.float64], faces: NDArray[np.integer], transform: Sequence[Sequence[float]]) -> bytes:
    """Draw a foot with its toes to the right, as PNG on a transparent ground.

    Parameters
    ----------
    vertices : (V, 3) finite, mm, scanner frame, V > 0
    faces : (F, 3)
    transform : 4 x 4, from the scanner's frame to the foot's
    """
    seen = upright(vertices, transform)
    low, high = seen.min(axis=0), seen.max(axis=0)
    size = np.maximum(high - low, 1e-3)
    scale = WIDTH_PX / max(_LONGEST_MM, float(size[0]), float(size[1]) * WIDTH_PX / HEIGHT_PX)
    middle = (low + high) / 2
    seen = seen - middle + [WIDTH_PX / scale / 2, -HEIGHT_PX / scale / 2, 0.0]
    colours = np.tile(np.array(MEASURED, np.uint8), (len(seen), 1))
    return png_bytes(render_mesh(seen, faces, colours, (HEIGHT_PX, WIDTH_PX), scale))

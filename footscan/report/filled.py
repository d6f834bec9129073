"""Colours of the measured and the filled parts of a surface."""

import numpy as np
from numpy.typing import NDArray

from footscan.report.markup import key, number
from schemas.quality import MeshQuality

MEASURED, FILLED, CUT = (224, 198, 178), (92, 107, 192), (176, 182, 188)
"""RGB: measured parts have the colour of skin, the others a colour that skin never has."""


def filled_colours(
    vertices: NDArray[np.float64], filled: NDArray[np.bool_] | None, cut_mm: float | None
) -> NDArray[np.uint8]:
    """RGB, (V, 3), of (V, 3) `vertices`, mm, scanner frame: measured, filled, or on the flat cut above the ankle.

    `filled` : (V,); None if unknown, then all vertices count as measured. `cut_mm` : Z of the flat cut, if any
    """
    colours = np.tile(np.array(MEASURED, np.uint8), (len(vertices), 1))
    if filled is not None:
        colours[filled] = FILLED
        if cut_mm is not None:
            colours[filled & (vertices[:, 2] == cut_mm)] = CUT
    return colours


def filled_key(mesh: MeshQuality) -> str:
    """Legend of the colours with their shares of the area; empty if it is unknown which parts are filled."""
    if mesh.filled_share is None:
        return ""
    cut = mesh.cut_share or 0.0
    parts = [("Measured", MEASURED, 1 - mesh.filled_share - cut), ("Filled", FILLED, mesh.filled_share)]
    if cut:
        parts.append(("Flat cut of the leg", CUT, cut))
    return key((f"{name}, {number(100 * share, 1)} %", colour) for name, colour, share in parts)

"""Places an object on the virtual scanner's glass."""

import numpy as np
from numpy.typing import NDArray

from footscan.virtual.portable import cos_sin, product
from schemas.parameters.simulation import SimulationSettings

Floats = NDArray[np.float64]

BLOCK_TURN_DEG = 5.0
"""Turn of the block about Z, chosen by hand. Stripes move gradually over its turned edges, which reveals the position
of the heads; no face is square to the travel."""


def stand_on_glass(vertices: Floats, middle_x_mm: float, turn_deg: float = 0.0) -> Floats:
    """(N, 3) `vertices`, mm, turned about Z and shifted onto the glass (Z = 0), with their middle at X and at Y = 0."""
    if turn_deg:
        cos, sin = cos_sin(turn_deg)
        vertices = product(vertices, np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = (low + high) / 2.0
    return np.asarray(vertices + np.array([middle_x_mm - middle[0], -middle[1], -low[2]]), np.float64)


def stand_in_the_middle(vertices: Floats, settings: SimulationSettings, turn_deg: float = 0.0) -> Floats:
    """`vertices` turned about Z and shifted onto the glass (Z = 0), to the middle of the travel and to Y = 0."""
    travel_middle = settings.start_mm + settings.step_mm * (settings.frames - 1) / 2
    return stand_on_glass(vertices, travel_middle, turn_deg)

"""The objects in front of the virtual scanner."""

import numpy as np
import pytest

from footscan.virtual.stage.standing import stand_in_the_middle
from pipelines.virtual_objects import virtual_object
from schemas.parameters.simulation import SimulationSettings


def test_block_is_turned_about_the_middle_of_the_travel() -> None:
    vertices, _, side = virtual_object(None, None, "unknown")
    settings = SimulationSettings(frames=101)
    square, turned = (stand_in_the_middle(vertices, settings, turn) for turn in (0.0, 5.0))
    assert side == "unknown"
    np.testing.assert_allclose(np.ptp(square, axis=0), [150, 100, 50])
    cos, sin = np.cos(np.radians(5)), np.sin(np.radians(5))
    np.testing.assert_allclose(np.ptp(turned, axis=0), [150 * cos + 100 * sin, 150 * sin + 100 * cos, 50])
    for placed in (square, turned):
        middle = (placed.min(axis=0) + placed.max(axis=0)) / 2
        assert middle[:2] == pytest.approx([100, 0])
        assert placed[:, 2].min() == 0
    # Counter-clockwise seen from above: the corner at +X, -Y goes to larger Y.
    corner = np.argmax(square[:, 0] - square[:, 1])
    assert turned[corner, 1] > square[corner, 1]

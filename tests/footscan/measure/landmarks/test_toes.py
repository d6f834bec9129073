"""Tips of the toes."""

import numpy as np
import pytest

from footscan.measure.landmarks.toes import toe_tips

LENGTH, SIDES = 260.0, (45.0, -45.0)


def rounded_toes(*tips: tuple[float, float]) -> np.ndarray:
    """A dense surface of toes 18 mm broad whose tips are at X and Y."""
    angle, height = np.meshgrid(np.linspace(-np.pi / 2, np.pi / 2, 61), np.arange(0.0, 20.0))
    return np.concatenate(
        [
            np.column_stack([x - 9.0 + 9.0 * np.cos(angle.ravel()), y + 9.0 * np.sin(angle.ravel()), height.ravel()])
            for x, y in tips
        ]
    )


def test_the_second_toe_is_that_beside_the_big_one() -> None:
    surface = rounded_toes((260.0, 24.0), (256.0, 3.0), (247.0, -12.0), (236.0, -25.0), (223.0, -39.0))
    found = toe_tips(surface, surface, LENGTH, 60.0, SIDES)
    assert found.tips[2].point[:2] == pytest.approx([256.0, 3.0], abs=0.6)


def test_a_forefoot_far_behind_the_curve_of_the_tips_has_none() -> None:
    """As where a lump behind the heel makes the foot too long."""
    surface = rounded_toes((200.0, 24.0), (196.0, 3.0))
    assert toe_tips(surface, surface, LENGTH, 60.0, SIDES).tips == {}

"""Tips at which the laser's sheet only grazes the surface."""

import numpy as np
import pytest

from footscan.surface.travel_ends import REACH_MM, travel_ends

STEP, RADIUS = 2.0, 20.0


def rings(beyond: float) -> np.ndarray:
    """Stripes on a sphere whose tip lies at X = 0, the first one `beyond` mm behind it."""
    x = beyond + STEP * np.arange(8)
    ring = np.sqrt(RADIUS**2 - (RADIUS - np.maximum(x, 0.05)) ** 2)
    angle = np.linspace(0, 2 * np.pi, 100)
    return np.concatenate(
        [
            np.column_stack([np.full(100, at), r * np.cos(angle), r * np.sin(angle)])
            for at, r in zip(x, ring, strict=True)
        ]
    )


@pytest.mark.parametrize("beyond", [-0.2, 0.0, 0.2])
def test_stripe_at_the_tip_says_only_that_the_tip_is_there(beyond: float) -> None:
    points = rings(beyond)
    grazing, (least, _) = travel_ends(points, STEP)
    assert (grazing == (points[:, 0] == beyond)).all()
    assert least == pytest.approx(beyond - REACH_MM)


@pytest.mark.parametrize("beyond", [0.4, 1.0, 1.9])
def test_other_stripes_count_and_the_surface_ends_within_a_step(beyond: float) -> None:
    grazing, (least, greatest) = travel_ends(rings(beyond), STEP)
    assert not grazing.any()
    assert (least, greatest) == (pytest.approx(beyond - STEP), pytest.approx(beyond + 8 * STEP))


def test_tip_of_a_longer_toe_is_held_against_its_own_section() -> None:
    points = rings(0.5)
    other = points[points[:, 0] > 2] + [0, 80, 0]
    grazing, _ = travel_ends(np.concatenate([points, other]), STEP)
    assert not grazing.any()

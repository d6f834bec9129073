"""The measuring of the exact surface, on straight tubes whose sections are known in closed form."""

import numpy as np
import pytest
from scipy.special import ellipe

from footscan.virtual.foot import measures as measure
from footscan.virtual.foot.field import (
    DOWN,
    HALF_WIDTH,
    INTERVALS,
    LEVEL,
    N_DOWN,
    N_UP,
    PROFILES,
    UP,
    Field,
    field_at,
    first_hits,
)


def straight_tube(half_width: float, up: float, down: float, exponent: float) -> Field:
    """A tube along X, its axis 50 mm above the floor; toes, leg and malleoli out of reach."""
    splines = np.zeros((6, INTERVALS, PROFILES, 4))
    splines[..., 3] = 1.0
    for profile, value in ((0, 0.0), (HALF_WIDTH, half_width), (LEVEL, 50.0), (UP, up), (DOWN, down),
                           (N_UP, exponent), (N_DOWN, exponent), (7, 0.0), (8, 0.0)):  # fmt: skip
        splines[:, :, profile, 3] = value
    caps = np.tile([0.0, 20.0, 260.0, 20.0, 0.0], (6, 1))
    caps[1:, 0] = np.inf
    return Field(splines, np.zeros(6), np.full(6, 260.0 / INTERVALS), caps, np.ones((INTERVALS, 4, 4)),
                 np.array([0.0, 1.0, 0.0, 1.0, 0.0]), -np.inf, np.ones((2, 6)))  # fmt: skip


def around(field: Field) -> float:
    return measure.girth(field, (130.0, 0.0, 50.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def test_girth_of_an_ellipse() -> None:
    assert around(straight_tube(40.0, 30.0, 30.0, 2.0)) == pytest.approx(4 * 40 * ellipe(1 - (30 / 40) ** 2), abs=0.003)


def test_girth_of_a_circle_across_a_tilted_plane_is_an_ellipse() -> None:
    """Tilted by 30 degrees about Y, the section of a cylinder of radius 30 has the half axes 30 and 30 / cos 30."""
    field = straight_tube(30.0, 30.0, 30.0, 2.0)
    tilted = (np.sin(np.radians(30)), 0.0, np.cos(np.radians(30)))
    known = 4 * 30 / np.cos(np.radians(30)) * ellipe(1 - np.cos(np.radians(30)) ** 2)
    assert measure.girth(field, (130.0, 0.0, 50.0), (0.0, 1.0, 0.0), tilted) == pytest.approx(known, abs=0.003)


def test_tape_bridges_a_hollow() -> None:
    """Of |u| + |v| with an exponent below 1 only the four tips touch the tape: a rhombus."""
    assert around(straight_tube(40.0, 30.0, 30.0, 0.7)) == pytest.approx(4 * 50.0, abs=0.01)


def test_extremes_of_a_tube() -> None:
    field = straight_tube(40.0, 30.0, 20.0, 2.5)
    assert measure.most_medial(field, (100.0, 150.0), 70.0)[1:] == pytest.approx((40.0, 50.0), abs=0.01)
    assert measure.most_lateral(field, (100.0, 150.0), 70.0)[1] == pytest.approx(-40.0, abs=1e-4)
    assert measure.top_height(field, 130.0, (-30.0, 30.0)) == pytest.approx(80.0, abs=1e-4)
    assert measure.arch_height(field, 260.0) == pytest.approx(50 - 20 * (1 - (1 / 3) ** 2.5) ** 0.4, abs=1e-3)


def test_ends_close_where_the_caps_say() -> None:
    field = straight_tube(40.0, 30.0, 20.0, 2.5)
    origins = np.array([[-50.0, 0.0, 50.0], [350.0, 0.0, 50.0]])
    hits = first_hits(origins, np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]), 200.0, field)
    assert hits == pytest.approx([50.0, 90.0], abs=1e-6)


def test_a_ray_that_misses_returns_its_reach() -> None:
    field = straight_tube(40.0, 30.0, 20.0, 2.5)
    hits = first_hits(np.array([[130.0, 60.0, 100.0]]), np.array([[1.0, 0.0, 0.0]]), 75.0, field)
    assert hits.tolist() == [75.0]


def test_field_is_about_the_distance_near_the_surface() -> None:
    field = straight_tube(30.0, 30.0, 30.0, 2.0)
    assert field_at(130.0, 31.0, 50.0, field) == pytest.approx(1.0, abs=0.05)
    assert field_at(130.0, 29.0, 50.0, field) == pytest.approx(-1.0, abs=0.05)

"""Frames of a stripe around known curves: its light, where it is visible, what stands still, equal bytes."""

import dataclasses

import numpy as np
import pytest

from footscan.virtual.filming.stripe_frames import (
    CENTRE,
    GHOST_STRENGTH,
    Clutter,
    Curve,
    StripeFilm,
    StripeFilmer,
    cross_profile,
    foot_section,
    parallel,
    signed_distance,
    sinusoid,
    straight_line,
)
from footscan.virtual.optics.scene import SKIN
from footscan.virtual.room.room import LEVELS
from footscan.virtual.stage.reference import standard_reference
from schemas.parameters.simulation import SimulationSettings

QUIET = SimulationSettings(
    ambient="dark", laser_exposure=0.6, speckle=0.0, halo=0.0, ghost=0.0, glints=0.0, flicker=0.0, texture=0.0
)
SKIN_IN_THE_DARK = LEVELS["dark"] * SKIN.albedo[0]
"""At most."""


def film(*curves: Curve, sigma_px: float = 2.0, clutter: Clutter | None = None, **settings: object) -> StripeFilm:
    return StripeFilm(curves, sigma_px, QUIET.model_copy(update=settings), clutter=clutter)


def red_light(shown: StripeFilm, frame: int = 0) -> np.ndarray:
    return StripeFilmer(shown).light(frame, np.random.default_rng(1))[:, :, 0]


def test_light_across_a_line_is_a_gaussian_over_the_area_of_a_pixel() -> None:
    # The middle of the picture is half a pixel below row 239: a line 0.3 px further down has its centre at 239.8.
    column = red_light(film(straight_line(0.0, 0.3)))[:, 320]
    fine = np.linspace(-0.5, 0.5, 401)
    for row in (234, 237, 239, 240, 241, 245):
        expected = 0.6 * np.exp(-0.5 * ((row + fine - 239.8) / 2.0) ** 2).mean()
        assert column[row] == pytest.approx(expected, abs=SKIN_IN_THE_DARK + 1e-4)


@pytest.mark.parametrize("degrees", [0.0, 15.0, 45.0, 70.0, 90.0, 165.0])
@pytest.mark.parametrize("exposure", [0.6, 24.0])
def test_centre_of_gravity_lies_on_the_line(degrees: float, exposure: float) -> None:
    line = straight_line(degrees, 2.7)
    light = red_light(film(line, laser_exposure=exposure)) - red_light(film(line, laser_exposure=0.0))
    rows, columns = np.nonzero(light > 0.0)
    distance = signed_distance(np.column_stack([columns, rows]).astype(float), [line])
    middle = np.hypot(columns - CENTRE[0], rows - CENTRE[1]) < 200.0
    weights = light[rows, columns][middle]
    assert np.average(distance[middle], weights=weights) == pytest.approx(0.0, abs=0.002)
    # A pixel's own breadth adds 1/12, whatever the direction.
    assert np.average(distance[middle] ** 2, weights=weights) == pytest.approx(2.0**2 + 1.0 / 12.0, rel=0.005)


def test_light_around_a_corner_falls_with_the_distance_to_the_polyline() -> None:
    corner = Curve(np.array([[320.0, 20.0], [320.0, 240.0], [620.0, 240.0]]))
    light = red_light(film(corner, sigma_px=3.0))
    assert light[235, 320] == pytest.approx(light[240, 325], abs=SKIN_IN_THE_DARK)
    assert light[244, 317] == pytest.approx(0.6 * np.exp(-0.5 * (5.0 / 3.0) ** 2), abs=SKIN_IN_THE_DARK + 0.002)
    # 3 px from both legs: as bright as beside the nearer one, not the sum of both.
    across, down = np.meshgrid(*2 * [np.linspace(2.5, 3.5, 201)])
    expected = 0.6 * np.exp(-0.5 * (np.minimum(across, down) / 3.0) ** 2).mean()
    assert light[237, 323] == pytest.approx(expected, abs=SKIN_IN_THE_DARK + 0.002)


def test_two_curves_add_up() -> None:
    one, other = straight_line(0.0, -2.0), straight_line(0.0, 2.0)
    room = red_light(film(one, laser_exposure=0.0))
    apart = red_light(film(one)) + red_light(film(other)) - room
    near = slice(200, 280)  # further off, one has less of the object around it than two
    np.testing.assert_allclose(red_light(film(one, other))[near], apart[near], atol=1e-6)


def test_signed_distance_is_positive_below_a_line_to_the_right() -> None:
    points = np.array([[10.0, 7.0], [10.0, 2.0], [-3.0, 1.0]])
    line = Curve(np.array([[0.0, 5.0], [20.0, 5.0]]))
    np.testing.assert_allclose(signed_distance(points, [line]), [2.0, -3.0, -5.0])
    far = Curve(np.array([[0.0, 8.0], [20.0, 8.0]]))
    np.testing.assert_allclose(signed_distance(points, [line, far]), [-1.0, -3.0, -5.0])
    assert signed_distance(CENTRE[None], [foot_section(100.0)])[0] > 50.0


def test_curves_run_where_they_are_told() -> None:
    np.testing.assert_allclose(signed_distance(CENTRE[None], [straight_line(30.0, 12.0)]), [-12.0])
    wave = sinusoid(90.0, 40.0, 240.0).points - CENTRE
    np.testing.assert_allclose(wave[:, 0], -40.0 * np.sin(2.0 * np.pi * wave[:, 1] / 240.0), atol=1e-9)
    profile = cross_profile(standard_reference().profile_mm, 3.0)
    assert profile.closed
    np.testing.assert_allclose(profile.points[0] - CENTRE, [-60.0, 150.0])  # Y = -20, Z = 0, 50 mm below the middle
    np.testing.assert_allclose(profile.points[3] - CENTRE, [150.0, 60.0])  # Y = 50, Z = 30


def test_parallel_curve_keeps_its_distance_round_corners() -> None:
    square = Curve(np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]]), closed=True)
    np.testing.assert_allclose(parallel(square, 5.0).points, [[5, 5], [35, 5], [35, 35], [5, 35]])
    np.testing.assert_allclose(signed_distance(parallel(foot_section(120.0), 20.0).points, [foot_section(120.0)]), 20.0,
                               atol=0.05)  # fmt: skip


def test_film_moves_and_turns() -> None:
    moving = dataclasses.replace(film(straight_line(0.0)), step_px=(1.0, 2.5), turn_degrees=3.0)
    (line,) = StripeFilmer(moving).curves(4)
    way = line.points[1] - line.points[0]
    assert np.degrees(np.arctan2(way[1], way[0])) == pytest.approx(12.0)
    np.testing.assert_allclose(signed_distance(CENTRE[None] + [4.0, 10.0], [line]), 0.0, atol=1e-9)


def test_visible_centres_are_half_a_pixel_apart_and_in_the_picture() -> None:
    centres = StripeFilmer(film(straight_line(0.0, 100.0))).visible_centres(0)
    assert len(centres) == pytest.approx(2 * 639, abs=2)
    np.testing.assert_allclose(np.diff(centres[:, 0]), 0.5)
    np.testing.assert_allclose(centres[:, 1], 339.5)
    assert centres[:, 0].min() >= 0.0
    assert centres[:, 0].max() <= 639.0


def test_stripe_is_invisible_where_the_room_is_brighter() -> None:
    # At the top, skin in a bright room is (1.38, 0.90, 0.67) of the white: a stripe lifts blue the most, by 0.09 each.
    faint, strong = (film(straight_line(90.0), ambient="bright", laser_exposure=light) for light in (0.3, 4.0))
    assert StripeFilmer(strong).visible_centres(0)[:, 1].min() == 0.0
    below = StripeFilmer(faint).visible_centres(0)[:, 1]
    # Red is at 0.95 where the shade is 0.95 / (2.2 * 0.66) = 0.654, at row 236.
    assert below.min() == pytest.approx(236, abs=4)
    assert below.max() == 479.0


def test_ghost_second_stripe_and_red_thing_are_there() -> None:
    line = straight_line(0.0)
    second = Curve(np.array([[100.0, 400.0], [200.0, 400.0]]))
    clutter = Clutter(ghost_px=30.0, second=second, second_strength=0.2, red_thing=(500.0, 60.0, 20.0))
    picture = red_light(film(line, clutter=clutter, ghost=1.0))
    assert picture[269:271, 320].mean() == pytest.approx(GHOST_STRENGTH * picture[239:241, 320].mean(), rel=0.1)
    assert picture[400, 150] == pytest.approx(0.2 * 0.6, rel=0.05)
    disc = picture[50:70, 490:510]
    assert disc.min() > 10.0 * picture[100:120, 490:510].mean()
    without = red_light(film(line, clutter=clutter))
    assert without[269:271, 320].mean() < 0.01


def test_clutter_of_the_head_stands_still() -> None:
    shown = film(straight_line(0.0, 150.0), clutter=Clutter(red_thing=(500.0, 60.0, 20.0)), glints=1.0)
    filmer = StripeFilmer(shown)
    first, later = (filmer.light(frame, np.random.default_rng(frame))[:200] for frame in (0, 6))
    assert (first.max(axis=2) > 0.3).sum() > 20
    np.testing.assert_array_equal(first, later)


def test_skin_is_around_the_stripe_and_a_darker_backdrop_beside() -> None:
    light = StripeFilmer(film(foot_section(100.0), ambient="ambient")).light(0, np.random.default_rng(1))
    skin = light[240, 320]
    np.testing.assert_allclose(skin / skin[0], np.array(SKIN.albedo) / SKIN.albedo[0], rtol=0.01)
    assert 0.25 * 0.66 * 0.5 < skin[0] < 0.25 * 0.66
    assert np.median(light[:40, :, 0]) < 0.5 * skin[0]


def test_equal_films_give_equal_bytes_in_any_order() -> None:
    settings = {"speckle": 0.12, "halo": 1.0, "glints": 1.0, "flicker": 1.0, "texture": 1.0}
    shown = film(foot_section(120.0), clutter=Clutter(), **settings)
    forth, back = StripeFilmer(shown), StripeFilmer(shown)
    assert [forth.jpeg(0), forth.jpeg(1)] == [back.jpeg(1), back.jpeg(0)][::-1]
    other = dataclasses.replace(shown, settings=shown.settings.model_copy(update={"seed": 2}))
    assert StripeFilmer(other).jpeg(0) != forth.jpeg(0)


def test_over_exposed_core_is_white_and_its_flanks_are_red() -> None:
    red, green, blue = StripeFilmer(film(straight_line(0.0), laser_exposure=24.0)).picture(0)[:, 320].astype(int).T
    assert red[240] == 255
    assert min(green[240], blue[240]) > 200
    assert ((red > 200) & (green < 140) & (blue < 140)).sum() >= 2

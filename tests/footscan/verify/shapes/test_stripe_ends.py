from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from footscan.verify.shapes.stripe_ends import (
    Beside,
    End,
    end_between_stripes,
    known_end,
    length_between,
    stripe_planes,
)

Floats = NDArray[np.float64]

PLANES = np.arange(0.0, 41.0, 2.0)
THIN = (0.0, 0.0)
ORIGIN = known_end(0.0, 0.0)


def stripes(planes: Floats = PLANES, displaced: float | Floats = 0.0) -> Beside:
    """40 points on each plane, half of them seen from before and half from behind the sheet, at a slope of a half.

    The light of the last stripe lies farther in by `displaced`, mm, that of the others where it should.
    """
    x = np.repeat(planes, 40)
    slope = np.tile([0.5, -0.5], len(x) // 2)
    off_face = np.zeros(len(x))
    off_face[-40:] = slope[-40:] * displaced
    return Beside(x, x, off_face, slope, (slope < 0).astype(np.intp))


def square_end(beside: Beside, sheet_mm: tuple[float, float] = (0.4, 0.4), planes: Floats = PLANES) -> End:
    return end_between_stripes(beside, planes, cosine=1.0, crossing_mm=0.0, sheet_mm=sheet_mm)


def told(end: End) -> tuple[float, float]:
    """Its place and standard uncertainty."""
    return length_between(end, ORIGIN)


def blind(beside: Beside) -> Beside:
    """The same, from places that nobody knows."""
    return replace(beside, slope=np.full(len(beside.x), np.nan))


def test_planes_by_hand() -> None:
    x = np.concatenate([np.full(9, 4.0), np.full(5, 2.0), np.full(7, 0.01), np.full(6, 8.0), np.full(6, 6.0), [7.1]])
    np.testing.assert_allclose(stripe_planes(x), [0.01, 2, 4, 6, 8])


def test_noise_along_the_travel_leaves_the_planes_apart() -> None:
    x = np.repeat(PLANES, 200) + np.random.default_rng(1).normal(0, 0.1, 200 * len(PLANES))
    np.testing.assert_allclose(stripe_planes(x), PLANES, atol=0.03)


def test_points_in_no_planes() -> None:
    assert len(stripe_planes(np.linspace(0, 100, 10_000))) == 0  # spread evenly: one plane
    assert len(stripe_planes(np.repeat(PLANES[:4], 50))) == 0  # too few
    assert len(stripe_planes(np.zeros(0))) == 0


def test_an_end_square_to_the_travel_lies_within_a_step() -> None:
    points = blind(stripes())
    assert told(square_end(points, THIN)) == pytest.approx((41, 2 / np.sqrt(12)), abs=0.01)
    other = replace(points, outward=-points.x)
    end = end_between_stripes(other, PLANES, cosine=-1.0, crossing_mm=0.0, sheet_mm=THIN)
    assert told(end) == pytest.approx((1, 2 / np.sqrt(12)), abs=0.01)  # -1 mm along X


def test_a_lost_frame_near_the_end_doubles_the_doubt() -> None:
    points = blind(stripes(np.delete(PLANES, -4)))
    end = square_end(points, THIN, planes=stripe_planes(points.x))
    assert told(end) == pytest.approx((42, 4 / np.sqrt(12)), abs=0.01)


def test_stray_points_beyond_the_end_do_not_count() -> None:
    points = blind(stripes())
    x = np.append(points.x, [42.0, 42.0, 44.0])
    nothing = np.zeros(3)
    points = Beside(
        x, x, np.append(points.off_face, nothing), np.append(points.slope, nothing), np.zeros(len(x), np.intp)
    )
    assert told(square_end(points, THIN))[0] == pytest.approx(41, abs=0.01)


def test_an_askew_end_is_where_its_stripes_run_out() -> None:
    # The end leans by 3 in 40: its edges reach 3 mm along X, more than a step, and 40 points stand 1 mm apart.
    turn = np.arctan2(3, 40)
    points = stripes()
    outward = points.x * np.cos(turn) + np.tile(np.arange(40.0), len(PLANES)) * np.sin(turn)
    inside = outward <= 35
    cut = Beside(points.x[inside], outward[inside], points.off_face[inside], points.slope[inside], points.view[inside])
    place, uncertainty = told(end_between_stripes(cut, PLANES, float(np.cos(turn)), 3.0, (0.2, 0.6)))
    assert abs(place - 35) < 2 * uncertainty
    assert uncertainty == pytest.approx(3 * np.sin(turn) / np.sqrt(12), rel=0.1)  # the third point from the end counts


@pytest.mark.parametrize(
    ("displaced", "beyond"),
    # 0.4 phi(u) / Phi(u), and 0.4 u, with the normal distribution's tables for u = -1/2, 0, 1/2 and 1.
    [
        (0.4 * 0.35207 / 0.30854, -0.2),
        (0.4 * 0.39894 / 0.5, 0.0),
        (0.4 * 0.35207 / 0.69146, 0.2),
        (0.4 * 0.24197 / 0.84134, 0.4),
    ],
)
def test_a_displaced_stripe_tells_how_far_beyond_it_the_end_is(displaced: float, beyond: float) -> None:
    place, uncertainty = told(square_end(stripes(displaced=displaced)))
    assert place == pytest.approx(40 + beyond, abs=0.03)
    assert uncertainty < 0.12  # a displacement that differs from theory by up to a fifth


def test_within_a_tilted_end_each_point_has_its_own_place() -> None:
    # Over the last stripe the end comes nearer by 0.4 mm: 0.2 to 0.6 beyond it, as far as one sheet of light reaches.
    points = stripes()
    ahead = np.tile(np.repeat(np.linspace(-0.2, 0.2, 20), 2), len(PLANES))
    beyond = (0.4 - ahead[-40:]) / 0.4
    share = np.array([0.5 * (1 + np.sign(u) * np.sqrt(1 - np.exp(-2 * u**2 / np.pi))) for u in beyond])  # Polya 1945
    displaced = 0.4 * np.exp(-0.5 * beyond**2) / np.sqrt(2 * np.pi) / share
    points = replace(stripes(displaced=displaced), outward=points.x + ahead)
    end = end_between_stripes(points, PLANES, cosine=1.0, crossing_mm=0.4, sheet_mm=(0.4, 0.4))
    assert told(end)[0] == pytest.approx(40.4, abs=0.04)


def test_of_a_whole_stripe_the_end_is_out_of_reach() -> None:
    place, uncertainty = told(square_end(stripes()))
    assert 40.7 < place - np.sqrt(3) * uncertainty < place + np.sqrt(3) * uncertainty < 42
    assert uncertainty < told(square_end(blind(stripes())))[1]


def test_one_sheet_is_wrong_at_both_ends() -> None:
    end = square_end(stripes(displaced=0.2), (0.2, 0.6))
    _, uncertainty = told(end)
    length, of_length = length_between(end, end)
    assert 0.15 < uncertainty < 0.3
    assert 1.7 * uncertainty < of_length < 2.2 * uncertainty
    assert length == pytest.approx(80.2, abs=of_length)
    # The narrower the sheet's width is known, the better is the end.
    assert told(square_end(stripes(displaced=0.2), (0.35, 0.45)))[1] < uncertainty / 2


def test_known_ends_add_up() -> None:
    assert length_between(known_end(30.0, 0.3), known_end(-10.0, 0.4)) == pytest.approx((20.0, 0.5))


@pytest.mark.parametrize("displaced", [-0.3, 5.0])
def test_what_no_end_explains_tells_nothing(displaced: float) -> None:
    nothing = told(square_end(blind(stripes()), (0.2, 0.6)))
    assert told(square_end(stripes(displaced=displaced), (0.2, 0.6))) == pytest.approx(nothing, abs=0.02)


def test_stripes_that_are_displaced_without_an_end_tell_nothing() -> None:
    restless = stripes(displaced=0.3)
    off_face = restless.slope * np.repeat(np.random.default_rng(2).normal(0, 4.0, len(PLANES)), 40)
    place, uncertainty = told(square_end(replace(restless, off_face=off_face), (0.2, 0.6)))
    assert (place, uncertainty) == pytest.approx(told(square_end(blind(restless), (0.2, 0.6))), abs=0.15)


def test_what_a_view_is_always_off_by_is_none_of_the_end() -> None:
    points = stripes(displaced=0.319)
    off = replace(points, off_face=points.off_face + 0.2 * points.view)
    assert told(square_end(off)) == pytest.approx(told(square_end(points)))

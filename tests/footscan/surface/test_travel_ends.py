"""Where the tips of heel and toes lie between the stripes."""

import numpy as np
import pytest

from footscan.surface.travel_ends import BEFORE_MM, BEHIND_MM, TravelEnd, drawn_to_tips, travel_ends

STEP, RADIUS = 2.0, 20.0


def rings(beyond: float, planes: int = 8, spot: float | None = None) -> np.ndarray:
    """Stripes on a sphere whose tip lies at X = 0, the first one `beyond` mm behind it; or there a spot of a radius."""
    x = beyond + STEP * np.arange(planes)
    ring = np.sqrt(np.maximum(RADIUS**2 - (RADIUS - x) ** 2, 0.0))
    if spot is not None:
        ring[0] = spot
    angle = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    return np.concatenate(
        [
            np.column_stack([np.full(100, at), r * np.cos(angle), r * np.sin(angle)])
            for at, r in zip(x, ring, strict=True)
        ]
    )


@pytest.mark.parametrize("beyond", [0.4, 1.0, 1.9])
def test_sections_of_a_sphere_tell_its_tip_exactly(beyond: float) -> None:
    grazing, (start, end) = travel_ends(rings(beyond), STEP)
    assert not grazing.any()
    assert (start.outward, start.last_mm, start.least_mm, start.most_mm) == (-1, beyond, 0, STEP)
    assert start.tip_mm == pytest.approx(beyond, abs=1e-9)
    assert start.limit == pytest.approx(beyond - STEP)
    assert end.limit == pytest.approx(beyond + 8 * STEP)


@pytest.mark.parametrize("beyond", [-0.4, -0.2, 0.0, 0.2])
def test_spot_at_the_tip_is_no_section(beyond: float) -> None:
    """3.8 mm are the radius of a section 0.36 mm behind the tip: too large for a section 0.3 mm behind it."""
    points = rings(beyond, spot=3.8)
    grazing, (start, _) = travel_ends(points, STEP)
    assert (grazing == (points[:, 0] == points[:, 0].min())).all()
    assert start.last_mm == beyond + STEP
    assert (start.least_mm, start.most_mm) == (STEP - BEFORE_MM, STEP + BEHIND_MM)
    assert start.tip_mm == pytest.approx(beyond + STEP, abs=1e-9)


def test_spot_on_a_blunt_end_is_one_whatever_the_sections_before_foretell() -> None:
    """Sections 40, 44 and 48 mm wide foretell an end far beyond the last stripe, which is a spot all the same."""
    angle = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    points = np.concatenate(
        [
            np.column_stack([np.full(300, x), r * np.cos(angle), r * np.sin(angle)])
            for x, r in ((0.0, 3.0), (2.0, 20.0), (4.0, 22.0), (6.0, 24.0))
        ]
    )
    grazing, _ = travel_ends(points, STEP)
    assert grazing.sum() == 300


def test_tip_is_that_of_the_longest_toe() -> None:
    """Two toes with stripes in the last plane, one ending 0.5 mm beyond it, the other 1.4 mm."""
    longer = rings(1.4) - [1.4, 0, 0]
    shorter = rings(0.5) - [0.5, 0, 0] + [0, 80, 0]
    grazing, (start, _) = travel_ends(np.concatenate([shorter, longer]), STEP)
    assert not grazing.any()
    assert start.tip_mm == pytest.approx(1.4, abs=1e-9)


def test_tip_of_a_longer_toe_is_held_against_its_own_section() -> None:
    points = rings(0.5)
    other = points[points[:, 0] > 2] + [0, 80, 0]
    grazing, (start, _) = travel_ends(np.concatenate([points, other]), STEP)
    assert not grazing.any()
    assert start.tip_mm == pytest.approx(0.5, abs=1e-9)


def test_toe_that_a_neighbour_joins_is_foretold_from_its_other_sections() -> None:
    """In the third plane the neighbour makes the box too wide, not too high: half the squared widths are 19.75 and
    93.75, a line through them falls to nothing after 19.75 / 74 steps, and heights tell 0.5 mm, a quarter of a step."""
    points = rings(0.5, planes=3)
    other = points[points[:, 0] > 4] + [0, 23, 0]
    grazing, (start, _) = travel_ends(np.concatenate([points, other]), STEP)
    assert not grazing.any()
    wide, high = 19.75 / 74, 0.25
    expected = (1 / wide + 1 / high) / (1 / wide**2 + 1 / high**2)
    assert start.tip_mm == pytest.approx(STEP * expected, rel=1e-6)


def test_sections_of_an_upright_cylinder_tell_its_side() -> None:
    """They are all equally high, give or take a hundredth of a millimetre."""
    x = 0.5 + STEP * np.arange(6)
    half = np.sqrt(RADIUS**2 - (RADIUS - x) ** 2)
    top = [90.0, 90.01, 89.99, 90.0, 90.01, 89.99]
    across = np.linspace(-1, 1, 50)
    points = np.concatenate(
        [
            np.column_stack([np.full(50, at), wide * across, np.where(across > 0, high, 0.0)])
            for at, wide, high in zip(x, half, top, strict=True)
        ]
    )
    _, (start, _) = travel_ends(points, STEP)
    assert start.tip_mm == pytest.approx(0.5, abs=0.01)


def test_single_stripe_tells_no_tip() -> None:
    grazing, (start, end) = travel_ends(rings(5.0, planes=1), STEP)
    assert not grazing.any()
    assert (start.tip_mm, end.tip_mm) == (None, None)
    assert (start.limit, end.limit) == (5.0 - STEP, 5.0 + STEP)


def test_cap_is_drawn_halfway_to_the_foretold_tip() -> None:
    """A cap 1.0 mm high whose tip is foretold 1.5 mm beyond the stripe becomes 1.25 mm high; half way, a quarter of the
    0.25 mm is added; nothing else moves."""
    ends = (TravelEnd(-1, 0.0, 0.0, STEP, 1.5), TravelEnd(1, 10.0, 0.0, STEP, None))
    vertices = np.array([[-1.0, 1, 2], [-0.5, 3, 4], [0.0, 5, 6], [5.0, 7, 8], [10.5, 9, 10]])
    moved = drawn_to_tips(vertices, ends)
    assert moved[:, 0] == pytest.approx([-1.25, -0.5625, 0.0, 5.0, 10.5])
    assert (moved[:, 1:] == vertices[:, 1:]).all()


def test_a_tip_is_as_doubtful_as_its_predictions_contradict_each_other_but_for_broad_ends() -> None:
    for tip_mm, is_broad, doubt_mm in ((1.0, False, 0.0), (1.6, False, 0.3), (1.6, True, 0.15), (None, False, 0.15)):
        end = TravelEnd(1, 10.0, 0.0, STEP, tip_mm, is_broad)
        assert end.doubt_mm(1.0) == pytest.approx(doubt_mm)
        assert end.doubt_mm(-0.5) == 0.0


def test_cap_ends_within_what_is_possible() -> None:
    ends = (TravelEnd(-1, 0.0, 1.5, 2.3, 9.0), TravelEnd(1, 10.0, 1.5, 2.3, 0.0))
    moved = drawn_to_tips(np.array([[-2.4, 0, 0], [5.0, 0, 0], [11.0, 0, 0]]), ends)
    assert moved[:, 0] == pytest.approx([-2.3, 5.0, 11.5])


def test_cap_does_not_fold_over_however_far_it_is_drawn_back() -> None:
    vertices = np.column_stack([np.linspace(0, 8, 50), np.zeros(50), np.zeros(50)])
    ends = (TravelEnd(-1, 0.0, 0.0, STEP, None), TravelEnd(1, 2.0, 0.0, STEP, 0.5))
    moved = drawn_to_tips(vertices, ends)
    assert moved[:, 0].max() == pytest.approx(2.0 + STEP)
    assert (np.diff(moved[:, 0]) > 0).all()


@pytest.mark.parametrize("beyond", [0.3, 1.5])
def test_planes_between_each_other_tell_the_tip_too(beyond: float) -> None:
    """Two heads whose planes are 0.9 mm apart, and a few points before all others that are none of the surface."""
    strays = np.array([[-1.0, y, 2.0] for y in range(5)])
    points = np.concatenate([rings(beyond), rings(beyond + 0.9), strays])
    _, (start, end) = travel_ends(points, STEP)
    assert start.last_mm == pytest.approx(beyond)
    assert start.tip_mm == pytest.approx(beyond, abs=0.02)
    assert end.limit == pytest.approx(beyond + 0.9 + 8 * STEP)


def test_a_broad_end_of_scattered_stripes_is_left_as_the_surface_continues_it() -> None:
    for radius, is_broad in ((25.0, True), (6.0, False)):
        angles = np.linspace(0.0, 2 * np.pi, 200)
        ring = np.column_stack([np.zeros(200), np.cos(angles), np.sin(angles)])
        x = np.concatenate([np.arange(-radius + away, radius, 2.0) for away in (0.7, 1.4, 2.2)])  # three heads
        points = np.concatenate([[place, 0.0, 0.0] + np.sqrt(radius**2 - place**2) * ring for place in x])
        _, ends = travel_ends(points, step_mm=2.0)
        assert ends[0].is_broad == is_broad
        reached = np.array([[-radius + 0.3, 0.0, 0.0], [0.0, 0.0, radius]])  # 0.3 mm short of the tip
        drawn = float(drawn_to_tips(reached, ends)[0, 0])
        assert drawn == reached[0, 0] if is_broad else drawn < reached[0, 0]

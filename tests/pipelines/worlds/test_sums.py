"""Sums of campaigns of made-up outcomes."""

import pytest

from footscan.virtual.worlds.draw import draw_world
from pipelines.worlds.page import campaign_page, world_page, worst_first
from pipelines.worlds.sums import drivers, numbers_of, silent_by_name, sum_up
from schemas.campaign import ShapeError, WorldMeasure, WorldOutcome
from schemas.measures import Status


def measure(error: float | None, sigma: float = 0.05, status: Status = "ok") -> WorldMeasure:
    value = None if status == "incomplete" else 100.0 + (error or 0.0)
    return WorldMeasure(value=value, truth=None if error is None else 100.0, sigma=sigma, status=status)


def shape(beyond_2mm: float = 0.0, mean: float = 0.1) -> ShapeError:
    return ShapeError(mean=mean, p95=0.3, p99=0.5, largest=3.0, beyond_1mm=beyond_2mm, beyond_2mm=beyond_2mm)


def outcome(
    seed: int = 1, covered: float = 1.0, surface: ShapeError | None = None, **measures: WorldMeasure
) -> WorldOutcome:
    return WorldOutcome(
        seed=seed, kind="points", covered=covered, surface=surface or shape(), cloud=shape(), measures=measures
    )


@pytest.mark.parametrize(
    ("of", "is_silent"),
    [
        (measure(0.2), False),
        (measure(0.31), True),
        (measure(-0.31), True),
        (measure(0.31, sigma=0.2), False),
        (measure(0.7, sigma=0.2), True),
        (measure(5.0, status="uncertain"), False),
        (measure(5.0, status="incomplete"), False),
        (measure(None), True),
        (measure(None, status="uncertain"), False),
    ],
)
def test_a_measure_is_silent_if_it_is_good_and_wrong(of: WorldMeasure, is_silent: bool) -> None:
    assert of.is_silent == is_silent


def test_a_lump_counts_where_measures_are_good() -> None:
    lump = shape(beyond_2mm=0.01)
    assert outcome(surface=lump, foot_length=measure(0.0)).silent_errors == ["surface"]
    assert outcome(surface=lump, foot_length=measure(0.0, status="uncertain")).silent_errors == []
    assert outcome(surface=shape(beyond_2mm=0.0005), foot_length=measure(0.0)).silent_errors == []


def test_a_lump_does_not_count_where_a_warning_is_given() -> None:
    lump = outcome(surface=shape(beyond_2mm=0.01), foot_length=measure(9.0))
    warned = lump.model_copy(update={"warnings": ["camera 3 deviates from the others by 2 mm"]})
    assert warned.silent_errors == ["foot_length"], "a warning does not make a good measure right"
    assert sum_up([lump, warned]).warned == 1


def test_refusals_are_right_where_stripes_are_missing_or_it_is_no_foot() -> None:
    bad = measure(9.0, status="incomplete")
    outcomes = [
        outcome(1, foot_length=measure(0.0)),
        outcome(2, foot_length=measure(9.0), ball_girth=measure(9.0)),
        outcome(3, covered=0.5, foot_length=bad),
        outcome(4, covered=1.0, foot_length=bad),
        outcome(5, covered=1.0, foot_length=bad, ball_girth=measure(None, status="incomplete")),
    ]
    sums = sum_up(outcomes)
    assert sums == (5, 2, 0, 1, 1, 2, 2, 1, 0)
    assert sums.figures("points")["points.silent_errors"] == 2.0
    assert silent_by_name(outcomes) == {"ball_girth": 1, "foot_length": 1}
    assert worst_first(outcomes)[0].seed == 2


def test_a_parameter_that_drives_an_error_comes_first() -> None:
    worlds = [draw_world(seed) for seed in range(60)]
    outcomes = [
        outcome(world.seed, surface=shape(mean=world.cameras.rolling_shutter_ms / 100.0), foot_length=measure(0.0))
        for world in worlds
    ]
    table = drivers(worlds, outcomes)
    assert next(iter(table)) == "cameras.rolling_shutter_ms"
    assert table["cameras.rolling_shutter_ms"]["surface, mean"] == pytest.approx(1.0)
    assert "foot_length" not in table["cameras.rolling_shutter_ms"], "an error that is the same everywhere"


def test_numbers_of_a_world_have_choices_and_largest_errors_of_heads() -> None:
    world = draw_world(7)
    numbers = numbers_of(world)
    assert numbers[f"laser.colour = {world.laser.colour}"] == 1.0
    assert numbers["heads.largest offset_mm"] == max(abs(head.offset_mm) for head in world.heads)
    assert numbers["cameras.missing, number"] == len(world.cameras.missing)
    assert "subject.shape_seed" not in numbers


def test_pages_show_what_is_wrong() -> None:
    outcomes = [outcome(1, foot_length=measure(0.0)), outcome(2, foot_length=measure(9.0))]
    page = campaign_page([draw_world(1), draw_world(2)], outcomes, "made up")
    assert "1 silent errors in 2 worlds" in page
    assert page.index("points-2.html") < page.index("points-1.html")
    own = world_page(draw_world(2), outcomes[1])
    assert "foot_<wbr>length" in own
    assert "109.00" in own

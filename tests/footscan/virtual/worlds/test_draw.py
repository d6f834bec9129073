"""Worlds follow from their seeds, and cover their ranges."""

from collections.abc import Callable

import numpy as np
import pytest

from footscan.virtual.worlds import draw
from footscan.virtual.worlds.draw import draw_world
from schemas.world import World, WorldRoom


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    return [draw_world(seed) for seed in range(400)]


def test_a_seed_gives_one_world(worlds: list[World]) -> None:
    assert draw_world(17) == worlds[17]
    assert len({world.model_dump_json() for world in worlds}) == len(worlds)


def test_a_world_survives_its_file(worlds: list[World]) -> None:
    for world in worlds[:20]:
        assert World.model_validate_json(world.model_dump_json()) == world


@pytest.mark.parametrize(
    ("value", "low", "high"),
    [
        (lambda w: w.laser.power, 4.0, 40.0),
        (lambda w: w.heads[1].offset_mm, -3.0, 3.0),
        (lambda w: w.heads[2].yaw_deg, -1.0, 1.0),
        (lambda w: w.heads[0].travel_scale, -0.005, 0.005),
        (lambda w: w.cameras.gain, 0.35, 2.8),
        (lambda w: w.cameras.rolling_shutter_ms, 0.0, 33.0),
        (lambda w: w.cameras.jpeg_quality, 60, 95),
        (lambda w: w.glass.ghost, 0.005, 0.05),
        (lambda w: w.glass.height_mm, -1.5, 1.5),
        (lambda w: w.subject.length_mm, 120.0, 330.0),
        (lambda w: w.subject.y_mm, -20.0, 20.0),
        (lambda w: w.subject.turn_deg, -20.0, 20.0),
    ],
)
def test_values_fill_their_range(worlds: list[World], value: Callable[[World], float], low: float, high: float) -> None:
    values = np.array([value(world) for world in worlds])
    assert low <= values.min() < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < values.max() <= high


def test_all_kinds_of_subjects_and_lasers_occur(worlds: list[World]) -> None:
    assert {world.subject.kind for world in worlds} == {"foot", "cast", "last"}
    assert {world.laser.colour for world in worlds} == {"red", "green", "blue"}
    assert {world.laser.lower_lasers for world in worlds} == {1, 2}
    assert {len(world.cameras.missing) for world in worlds} == {0, 1, 2, 4}
    assert any(world.subject.deformity.amputated_at for world in worlds)
    assert any(world.subject.deformity.missing_toes for world in worlds)


def test_casts_and_lasts_are_seen_by_the_upper_cameras_alone(worlds: list[World]) -> None:
    for world in worlds:
        if world.subject.kind != "foot":
            assert world.cameras.missing == [5, 6, 7, 8]
            assert world.subject.tremor_mm == 0.0


def test_a_new_quantity_in_one_part_leaves_the_others(worlds: list[World], monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = draw._room

    def with_one_more(random: np.random.Generator) -> WorldRoom:
        random.random()
        return drawn(random)

    monkeypatch.setattr(draw, "_room", with_one_more)
    changed = draw_world(3)
    assert changed.room != worlds[3].room
    assert changed.model_copy(update={"room": worlds[3].room}) == worlds[3]

"""The worlds of a suite in one night: the fixed ones, fresh ones of the day, and earlier ones that failed."""

import json
from collections.abc import Callable, Sequence
from datetime import date
from pathlib import Path
from typing import NamedTuple

from footscan.virtual.worlds.draw import draw_world
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.pool import cores, local_cluster
from pipelines.worlds.campaign import run_worlds
from pipelines.worlds.page import WORST_SHOWN, campaign_page, world_page, world_page_name, worst_first
from pipelines.worlds.sums import sum_up
from schemas.base.errors import RefusedInput
from schemas.base.json_files import read_json
from schemas.campaign import WorldOutcome
from schemas.parameters.scan import ScanParameters
from schemas.regression import SuiteWorlds
from schemas.world import World

PAGE = "worlds.html"
PAGES = "worlds"
"""Folder of the pages of single worlds."""
KEPT = "kept.json"
"""Seeds of fresh worlds that failed: they are run every night from then on."""


class WorldsNight(NamedTuple):
    """The outcome of the worlds of a night."""

    figures: dict[str, float | None]
    """Sums of the fixed worlds, which are the same every night."""
    page: Path


def run_night_of_worlds(
    worlds: SuiteWorlds,
    parameters: ScanParameters,
    base: Path,
    out: Path,
    day: date,
    name: str,
    on_world: Callable[[int, int], None],
) -> WorldsNight:
    """Run the worlds of a suite and write their pages.

    Parameters
    ----------
    base : folder that the suite's paths are relative to.
    out : folder of the suite's nights.
    day : its fresh worlds are drawn.
    on_world : called with the number of worlds done and in total.

    Raises
    ------
    RefusedInput
        A described world is missing, breaks its format, or has the seed of another film.
    Fault
        A step failed for a reason that is not the world's, or the disk refuses.
    """
    fixed, kept, fresh = worlds.points.seeds, read_kept(out), fresh_seeds(day, worlds.fresh_points)
    without_pictures = [draw_world(seed) for seed in dict.fromkeys([*fixed, *kept, *fresh])]
    filmed = [draw_world(seed) for seed in ([] if worlds.films is None else worlds.films.seeds)]
    filmed += [read_json(base / file, World) for file in worlds.described]
    seeds = [world.seed for world in filmed]
    if twice := sorted({seed for seed in seeds if seeds.count(seed) > 1}):
        raise RefusedInput("worlds.described", f"world {twice[0]} is filmed twice, expected each seed once")
    done: list[WorldOutcome] = []

    def count(outcome: WorldOutcome) -> None:
        done.append(outcome)
        on_world(len(done), len(without_pictures) + len(filmed))

    with local_cluster(cores()) as pool:
        points = run_worlds(without_pictures, "points", parameters, out / PAGES, pool, count)
        films = run_worlds(filmed, "films", parameters, out / PAGES, pool, count)
    by_seed = {outcome.seed: outcome for outcome in points}
    failed = [seed for seed in fresh if by_seed[seed].silent_errors or by_seed[seed].crashed]
    write_atomically(out / PAGES / KEPT, json.dumps(sorted({*kept, *failed})).encode())
    page = write_pages([*without_pictures, *filmed], [*points, *films], out, name)
    figures = sum_up([by_seed[seed] for seed in fixed]).figures("points")
    return WorldsNight(figures | (sum_up(films).figures("films") if films else {}), page)


def write_pages(worlds: Sequence[World], outcomes: Sequence[WorldOutcome], out: Path, name: str) -> Path:
    """Write the page of a campaign and those of its worst worlds; returns the path of the first."""
    by_page = {world_page_name(outcome): world for world, outcome in zip(worlds, outcomes, strict=True)}
    for outcome in worst_first(outcomes)[:WORST_SHOWN]:
        page = world_page_name(outcome)
        write_atomically(out / PAGES / page, world_page(by_page[page], outcome).encode())
    write_atomically(out / PAGE, campaign_page(worlds, outcomes, name).encode())
    return out / PAGE


def fresh_seeds(day: date, count: int) -> list[int]:
    """Return the seeds of a day, which no other day has: at most 100.

    >>> fresh_seeds(date(2026, 11, 23), 2)
    [2026112300, 2026112301]
    """
    return [int(f"{day:%Y%m%d}") * 100 + number for number in range(count)]


def read_kept(out: Path) -> list[int]:
    """Return the seeds of earlier fresh worlds that failed; RefusedInput if the file is no list of numbers."""
    file = out / PAGES / KEPT
    if not file.exists():
        return []
    try:
        return [int(seed) for seed in json.loads(file.read_text(encoding="utf-8"))]
    except (ValueError, TypeError):
        raise RefusedInput(file, "expected a list of seeds") from None

"""The worlds of a suite in one night: the fixed ones, fresh ones of the day, and earlier ones that failed."""

import json
from collections.abc import Callable
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
from schemas.campaign import WorldOutcome
from schemas.parameters.scan import ScanParameters
from schemas.regression import SuiteWorlds

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
    out: Path,
    day: date,
    name: str,
    on_world: Callable[[int, int], None],
) -> WorldsNight:
    """Run the worlds of a suite and write their pages.

    Parameters
    ----------
    out : folder of the suite's nights.
    day : its fresh worlds are drawn.
    on_world : called with the number of worlds done and in total.

    Raises
    ------
    Fault
        A step failed for a reason that is not the world's, or the disk refuses.
    """
    fixed = worlds.points.seeds
    kept = read_kept(out)
    fresh = fresh_seeds(day, worlds.fresh_points)
    seeds = list(dict.fromkeys([*fixed, *kept, *fresh]))
    filmed = [] if worlds.films is None else worlds.films.seeds
    done: list[WorldOutcome] = []

    def count(outcome: WorldOutcome) -> None:
        done.append(outcome)
        on_world(len(done), len(seeds) + len(filmed))

    with local_cluster(cores()) as pool:
        points = {o.seed: o for o in run_worlds(seeds, "points", parameters, out / PAGES, pool, count)}
        films = run_worlds(filmed, "films", parameters, out / PAGES, pool, count)
    failed = [seed for seed in fresh if points[seed].silent_errors or points[seed].crashed]
    write_atomically(out / PAGES / KEPT, json.dumps(sorted({*kept, *failed})).encode())
    page = write_pages([*points.values(), *films], out, name)
    figures = sum_up([points[seed] for seed in fixed]).figures("points")
    return WorldsNight(figures | (sum_up(films).figures("films") if films else {}), page)


def write_pages(outcomes: list[WorldOutcome], out: Path, name: str) -> Path:
    """Write the page of a campaign and those of its worst worlds; returns the path of the first."""
    worlds = {outcome.seed: draw_world(outcome.seed) for outcome in outcomes}
    for outcome in worst_first(outcomes)[:WORST_SHOWN]:
        write_atomically(out / PAGES / world_page_name(outcome), world_page(worlds[outcome.seed], outcome).encode())
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

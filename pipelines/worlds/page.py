"""The page of a campaign: its sums, what drives its errors, and its worst worlds first."""

from collections.abc import Sequence

from footscan.report.markup import breakable, facts, number, section, table, text
from footscan.report.page import page
from pipelines.worlds.sums import ERRORS, drivers, numbers_of, silent_by_name, sum_up
from schemas.campaign import WorldMeasure, WorldOutcome
from schemas.world import World

DRIVERS_SHOWN = 40
"""Parameters in the map of drivers; the rest have weaker correlations. Chosen by hand."""
WORST_SHOWN = 60
"""Worlds with a page of their own."""


def worst_first(outcomes: Sequence[WorldOutcome]) -> list[WorldOutcome]:
    """Sort outcomes: crashes and most silent errors first, then the largest errors of the surface."""

    def badness(outcome: WorldOutcome) -> tuple[bool, int, float]:
        return outcome.crashed, len(outcome.silent_errors), 0.0 if outcome.surface is None else outcome.surface.mean

    return sorted(outcomes, key=badness, reverse=True)


def world_page_name(outcome: WorldOutcome) -> str:
    """Return the file name of the page of a world."""
    return f"{outcome.kind}-{outcome.seed}.html"


def campaign_page(worlds: Sequence[World], outcomes: Sequence[WorldOutcome], name: str) -> str:
    """Return the self-contained HTML page of a campaign: worlds and what came of each, in one order.

    The worst ones link to `world_page`.
    """
    sums = sum_up(outcomes)
    tiles = [
        ("worlds", str(sums.worlds)),
        ("silent errors", f"{sums.silent_errors} in {sums.silent_worlds} worlds"),
        ("measured", str(sums.measured)),
        ("refused needlessly", str(sums.refused_needlessly)),
    ]
    by_name = [[breakable(error), str(count)] for error, count in silent_by_name(outcomes).items()]
    return page(
        title=f"{name}: {sums.silent_errors} silent errors",
        style=_STYLE,
        kicker="Campaign of worlds",
        heading=f"{text(name)} <span>{sums.silent_errors} silent errors in {sums.worlds} worlds</span>",
        parts=[
            facts(tiles),
            section("Sums", _sums(outcomes)),
            section("Silent errors", _MEANING, table(["measure", "worlds"], by_name, numeric=(1,))),
            section("What drives the errors", _drivers(worlds, outcomes)),
            section("Worst worlds", _worst(worst_first(outcomes)[:WORST_SHOWN])),
        ],
    )


def world_page(world: World, outcome: WorldOutcome) -> str:
    """Return the self-contained HTML page of one world: what was measured, the truth, and all its parameters."""
    shapes = [
        [
            name,
            *(number(value, 3) for value in (shape.mean, shape.p95, shape.p99, shape.largest)),
            number(100.0 * shape.beyond_1mm, 2),
            number(100.0 * shape.beyond_2mm, 2),
        ]
        for name, shape in (("cloud", outcome.cloud), ("surface", outcome.surface))
        if shape is not None
    ]
    covered = f"<p>Stripes cover {100.0 * outcome.covered:.0f} % of the true surface.</p>"
    headings = ["", "mean, mm", "95 %", "99 %", "largest", "beyond 1 mm, %", "beyond 2 mm, %"]
    measures = [_measure(name, measure) for name, measure in outcome.measures.items()]
    parameters = [[breakable(name), f"{value:.6g}"] for name, value in sorted(numbers_of(world).items())]
    return page(
        title=f"World {world.seed}",
        style=_STYLE,
        kicker=f"World of {outcome.kind}",
        heading=f"World {world.seed} <span>{len(outcome.silent_errors)} silent errors</span>",
        parts=[
            *([f'<p class="problem">{text(outcome.problem)}</p>'] if outcome.problem else []),
            *(f'<p class="note">{text(warning)}</p>' for warning in outcome.warnings),
            section("Shape", table(headings, shapes, numeric=tuple(range(1, 7))), covered),
            section(
                "Measures",
                table(["", "value", "truth", "error", "sigma", "status"], measures, numeric=(1, 2, 3, 4)),
            ),
            section("Parameters", table(["parameter", "value"], parameters, numeric=(1,))),
            section("Once more", _AGAIN.format(seed=world.seed)),
            section("The world", f"<pre>{text(world.model_dump_json(indent=2))}</pre>"),
        ],
    )


def _sums(outcomes: Sequence[WorldOutcome]) -> str:
    rows = []
    for kind in sorted({outcome.kind for outcome in outcomes}, reverse=True):
        sums = sum_up([outcome for outcome in outcomes if outcome.kind == kind])
        rows.append([kind, *map(str, sums)])
    headings = [
        "worlds of", "worlds", "measured", "with warnings", "right measures", "worlds with silent errors",
        "silent errors", "refused rightly", "refused needlessly", "crashed",
    ]  # fmt: skip
    return table(headings, rows, numeric=tuple(range(1, len(headings))))


def _drivers(worlds: Sequence[World], outcomes: Sequence[WorldOutcome]) -> str:
    rows = [
        [breakable(name), *(_correlation(row.get(error)) for error in ERRORS)]
        for name, row in list(drivers(worlds, outcomes).items())[:DRIVERS_SHOWN]
    ]
    meaning = "<p>Spearman's rank correlation of each parameter with each error; 0.1 may be chance in 500 worlds.</p>"
    return meaning + table(["parameter", *ERRORS], rows, numeric=tuple(range(1, len(ERRORS) + 1)))


def _correlation(value: float | None) -> str:
    if value is None:
        return "–"
    colour = "200, 60, 40" if value > 0.0 else "40, 90, 200"
    return f'<span class="cell" style="background: rgba({colour}, {min(abs(value) * 1.6, 0.9):.2f})">{value:.2f}</span>'


def _worst(outcomes: Sequence[WorldOutcome]) -> str:
    rows = [
        [
            f'<a href="worlds/{world_page_name(outcome)}">{outcome.seed}</a>',
            outcome.kind,
            str(len(outcome.silent_errors)),
            text(", ".join(outcome.silent_errors) or outcome.problem or ""),
            "–" if outcome.surface is None else number(outcome.surface.mean, 2),
            "–" if outcome.surface is None else number(100.0 * outcome.surface.beyond_2mm, 2),
            "–" if outcome.cloud is None else number(100.0 * outcome.cloud.beyond_1mm, 1),
            number(100.0 * outcome.covered),
        ]
        for outcome in outcomes
    ]
    headings = [
        "world", "kind", "silent", "which", "surface mean, mm", "beyond 2 mm, %", "cloud beyond 1 mm, %", "covered, %",
    ]  # fmt: skip
    return table(headings, rows, numeric=(2, 4, 5, 6, 7))


def _measure(name: str, measure: WorldMeasure) -> list[str]:
    error = measure.error
    mark = ' class="problem"' if measure.is_silent else ""
    return [
        f"<span{mark}>{breakable(name)}</span>",
        *("–" if value is None else number(value, 2) for value in (measure.value, measure.truth, error, measure.sigma)),
        measure.status,
    ]


_MEANING = (
    "<p>A measure is a silent error if it is reported as good and is off by more than 0.3 mm and three of its standard "
    "deviations, or if the object has no such measure. A surface is one if more than 0.1 % of its measured part is "
    "farther than 2 mm from the truth although measures are reported as good and nothing warns of it.</p>"
)
_AGAIN = (
    "<p>Films of this world, and the whole report of its scan:</p>"
    "<pre>footscan simulate world --seed {seed} --out world-{seed}\n"
    "footscan run --scan world-{seed} --out results</pre>"
)
_STYLE = ".cell { display: inline-block; min-width: 3.2em; padding: 0 0.3em; text-align: right; }"

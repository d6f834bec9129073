"""Are the uncertainties true? |error| / sd of measures in worlds drawn at random, and how many stay `ok`.

    .venv/bin/python -m benchmarks.uncertainty [FIRST COUNT [FOLDER [drawn | assembled | moving | passing [KIND]]]]

The baseline is the standard normal: 68 % within one standard deviation, 99.7 % within three. `drawn` worlds have all
faults at once (`draw_world`), most of them heads that the calibration has never seen: what counts are silent errors.
`assembled` scanners (`draw_assembled`) are calibrated by a chart and the film of a body; their data allow all measures,
so most should stay `ok`. `moving` ones (`draw_moving`) film a foot that sways and trembles by tenths of a millimetre,
`passing` ones (`draw_passing`) film it in two passes. KIND is points or films. FOLDER keeps what came of each world.
"""

import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from footscan.calibration.travel.body import standard_body
from footscan.virtual.worlds.draw import draw_assembled, draw_moving, draw_passing, draw_world
from pipelines.engine.pool import cores, local_cluster
from pipelines.worlds.campaign import run_worlds
from pipelines.worlds.sums import silent_by_name, sum_up
from schemas.campaign import WorldKind, WorldMeasure, WorldOutcome
from schemas.parameters.scan import ScanParameters

FIRST, COUNT = 5001, 60
MAIN = ("foot_length", "foot_breadth", "ball_girth")
"""The measures that a world should keep `ok`."""
DRAW = {"drawn": draw_world, "assembled": draw_assembled, "moving": draw_moving, "passing": draw_passing}


def main() -> None:
    first, count = [int(text) for text in sys.argv[1:3]] or [FIRST, COUNT]
    kind: WorldKind = "films" if "films" in sys.argv[4:] else "points"
    drawn = next((name for name in sys.argv[4:] if name in DRAW), "drawn")
    body = None if drawn == "drawn" else standard_body()
    with tempfile.TemporaryDirectory() as temporary, local_cluster(cores()) as pool:
        folder = Path(sys.argv[3] if len(sys.argv) > 3 else temporary)
        worlds = [DRAW[drawn](seed) for seed in range(first, first + count)]
        outcomes = run_worlds(worlds, kind, ScanParameters(), folder, pool, lambda _: None, body)
    print(f"{sum_up(outcomes)}\nsilent errors: {silent_by_name(outcomes)}")
    _print_ratios(outcomes)
    _print_kept(outcomes)


def _print_ratios(outcomes: Sequence[WorldOutcome]) -> None:
    names = sorted({name for outcome in outcomes for name in outcome.measures})
    for name in [*names, "all"]:
        chosen = [m for o in outcomes for n, m in o.measures.items() if name in (n, "all")]
        print(f"{name:26} {_within(measure for measure in chosen if measure.status == 'ok')}")


def _within(measures: Iterable[WorldMeasure]) -> str:
    ratios = np.abs([m.error / m.sigma for m in measures if m.error is not None and m.sigma])
    if not len(ratios):
        return "none ok"
    return f"{len(ratios):6} ok, within 1 sd {np.mean(ratios < 1):4.0%}, 3 sd {np.mean(ratios < 3):6.1%}"


def _print_kept(outcomes: Sequence[WorldOutcome]) -> None:
    covered = [outcome for outcome in outcomes if outcome.can_be_measured]
    for name in MAIN:
        ok = sum(name in o.measures and o.measures[name].status == "ok" for o in covered)
        print(f"{name:26} ok in {ok} of {len(covered)} worlds whose stripes cover a foot")
    kept = sum(all(n in o.measures and o.measures[n].status == "ok" for n in MAIN) for o in covered)
    print(f"{'all three':26} ok in {kept} of {len(covered)}")


if __name__ == "__main__":
    main()

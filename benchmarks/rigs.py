"""Scanners of two to twelve cameras, and with two laser planes below, beside the standard one: worlds without pictures.

    .venv/bin/python -m benchmarks.rigs [FIRST COUNT [FOLDER]]

Each foot (`draw_assembled`, its scanner without errors) is measured by each scanner. FOLDER keeps what came of it.
"""

import sys
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from footscan.virtual.worlds.draw import as_designed, draw_assembled
from pipelines.engine.pool import cores, local_cluster
from pipelines.worlds.campaign import run_worlds
from schemas.campaign import WorldOutcome
from schemas.parameters.scan import ScanParameters
from schemas.world import World, WorldLaser, WorldRig

FIRST, COUNT = 1, 5
APART_MM = 12.0
RIGS: Mapping[str, dict[str, object]] = {
    "8 cameras, standard": {},
    "8 cameras, two planes below": {"laser": WorldLaser(lower_lasers=2, lower_apart_mm=APART_MM)},
    "2 cameras above": {"rig": WorldRig(above=2, below=0)},
    "4 cameras, 2 below": {"rig": WorldRig(above=2, below=2)},
    "6 cameras, 3 below": {"rig": WorldRig(above=3, below=3)},
    "12 cameras, 6 below": {"rig": WorldRig(above=6, below=6)},
    "12 cameras, two planes below": {
        "rig": WorldRig(above=6, below=6), "laser": WorldLaser(lower_lasers=2, lower_apart_mm=APART_MM)
    },
}  # fmt: skip
MEASURES = ("foot_length", "foot_breadth", "ball_girth", "instep_girth")


def main() -> None:
    numbers = [int(text) for text in sys.argv[1:3]] or [FIRST, COUNT]
    worlds = [as_designed(draw_assembled(seed)) for seed in range(numbers[0], numbers[0] + numbers[1])]
    if len(sys.argv) > 3:
        _compare(worlds, Path(sys.argv[3]))
    else:
        with tempfile.TemporaryDirectory() as folder:
            _compare(worlds, Path(folder))


def _compare(worlds: Sequence[World], folder: Path) -> None:
    with local_cluster(cores()) as pool:
        for name, changes in RIGS.items():
            changed = [world.model_copy(update=changes) for world in worlds]
            outcomes = run_worlds(changed, "points", ScanParameters(), folder, pool, lambda _: None)
            _print(name, outcomes)


def _print(name: str, outcomes: Sequence[WorldOutcome]) -> None:
    means = [outcome.surface.mean for outcome in outcomes if outcome.surface is not None]
    surface = "no surface" if not means else f"surface {np.median(means):.3f} ({max(means):.3f}) mm"
    print(f"{name}: {surface}; covered {np.median([outcome.covered for outcome in outcomes]):.2f}")
    for measure in MEASURES:
        known = [outcome.measures[measure] for outcome in outcomes if measure in outcome.measures]
        errors = [each.error for each in known if each.status == "ok" and each.error is not None]
        off = "" if not errors else f", off by {np.median(np.abs(errors)):.2f} ({np.max(np.abs(errors)):.2f}) mm"
        print(f"  {measure:14} {dict(Counter(each.status for each in known))}{off}")
    print(f"  silent errors {sum(len(outcome.silent_errors) for outcome in outcomes)}")
    print(f"  ok {Counter(n for o in outcomes for n, m in o.measures.items() if m.status == 'ok')}")
    for outcome in outcomes:
        for warning in [*([outcome.problem] if outcome.problem else []), *outcome.warnings]:
            print(f"    {outcome.seed}: {warning}")


if __name__ == "__main__":
    main()

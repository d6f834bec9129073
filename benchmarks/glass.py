"""Plates that were moved since the calibration: worlds without pictures, the plate as the only fault, or one of many.

    .venv/bin/python -m benchmarks.glass [FIRST COUNT [FOLDER]]

Three runs of COUNT worlds: ideal scanners on an exact plate, the same on plates that stand up to 2 mm higher or lower
and are tilted by up to half a degree about X and Y, and worlds with all faults (`draw_world`) on such plates. FOLDER
keeps what came of each world, by the code that computed it: run in two versions of the project, it compares them.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from footscan.virtual.worlds.draw import as_designed, draw_assembled, draw_world
from pipelines.engine.pool import local_cluster
from pipelines.worlds.campaign import run_worlds
from schemas.campaign import WorldOutcome
from schemas.parameters.scan import ScanParameters
from schemas.world import World

FIRST, COUNT = 1, 20
HEIGHT_MM, TILT_DEG = 2.0, 0.5
"""Largest height and tilt of a plate that was taken out and put back: those of drawn worlds (`docs/worlds.md`), and a
height of 0.5 mm more."""
SHOWN = ("foot_length", "ball_girth", "instep_height", "arch_height", "arch_index")


def main() -> None:
    first, count = [int(text) for text in sys.argv[1:3]] or [FIRST, COUNT]
    seeds = range(first, first + count)
    exact = [as_designed(draw_assembled(seed)) for seed in seeds]
    worlds = {
        "exact plate": exact,
        "moved plate": [on_moved_plate(world) for world in exact],
        "all faults": [on_moved_plate(draw_world(seed)) for seed in seeds],
    }
    with tempfile.TemporaryDirectory() as temporary, local_cluster(1) as pool:
        folder = Path(sys.argv[3]) if len(sys.argv) > 3 else Path(temporary)
        for name, drawn in worlds.items():
            outcomes = run_worlds(drawn, "points", ScanParameters(), folder, pool, _show)
            print(f"\n{name}: {len(outcomes)} worlds; median (largest)")
            _summary(outcomes)


def on_moved_plate(world: World) -> World:
    """The world on a plate that stands elsewhere than when the scanner was calibrated; drawn by the world's seed."""
    random = np.random.default_rng([world.seed, 500])
    height, tilt_x, tilt_y = random.uniform(-1.0, 1.0, 3) * [HEIGHT_MM, TILT_DEG, TILT_DEG]
    moved = {"height_mm": float(height), "tilt_x_deg": float(tilt_x), "tilt_y_deg": float(tilt_y)}
    return world.model_copy(update={"glass": world.glass.model_copy(update=moved)})


def _summary(outcomes: Sequence[WorldOutcome]) -> None:
    means = np.array([np.nan if outcome.surface is None else outcome.surface.mean for outcome in outcomes])
    print(f"  surface        {_spread(means)} mm")
    for name in SHOWN:
        known = [outcome.measures[name] for outcome in outcomes if name in outcome.measures]
        errors = [abs(measure.error) for measure in known if measure.error is not None]
        ok = sum(measure.status == "ok" for measure in known)
        print(f"  {name:14} {_spread(errors)}, ok in {ok}" if errors else f"  {name:14} -, ok in {ok}")
    silent = [name for outcome in outcomes for name in outcome.silent_errors]
    right = sum(
        measure.status == "ok" and not measure.is_silent
        for outcome in outcomes
        for measure in outcome.measures.values()
    )
    print(f"  silent errors  {len(silent)} in {sum(bool(o.silent_errors) for o in outcomes)} worlds, right {right}")
    print(f"  not measured   {sum(not outcome.is_measured for outcome in outcomes)}")


def _spread(values: Sequence[float] | np.ndarray) -> str:
    return f"{np.nanmedian(values):.3f} ({np.nanmax(values):.3f})"


def _show(outcome: WorldOutcome) -> None:
    print("!" if outcome.problem else ".", end="", flush=True)


if __name__ == "__main__":
    main()

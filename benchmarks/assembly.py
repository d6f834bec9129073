"""Scanners that were assembled at home, beside the ideal one: worlds without pictures, with one calibration or two.

    .venv/bin/python -m benchmarks.assembly [FIRST COUNT [FOLDER]]

Each scanner (`draw_assembled`) measures one foot three times: ideal, calibrated by its chart alone, and calibrated by
the chart and the film of the standard body. The baseline is the ideal scanner. Then each parameter of the laser planes
is compared with the truth, in its standard deviations. FOLDER keeps what came of each world.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from footscan.calibration.travel.body import standard_body
from footscan.virtual.worlds.draw import as_designed, draw_assembled
from pipelines.engine.pool import cores, local_cluster
from pipelines.worlds.campaign import run_worlds
from schemas.campaign import WorldOutcome
from schemas.parameters.scan import ScanParameters
from schemas.world import World

FIRST, COUNT = 1, 50


def main() -> None:
    numbers = [int(text) for text in sys.argv[1:3]] or [FIRST, COUNT]
    worlds = [draw_assembled(seed) for seed in range(numbers[0], numbers[0] + numbers[1])]
    if len(sys.argv) > 3:
        _compare(worlds, Path(sys.argv[3]))
    else:
        with tempfile.TemporaryDirectory() as folder:
            _compare(worlds, Path(folder))


def _compare(worlds: Sequence[World], folder: Path) -> None:
    ideal = [as_designed(world) for world in worlds]
    with local_cluster(cores()) as pool:
        runs = {
            "ideal scanner": run_worlds(ideal, "points", ScanParameters(), folder, pool, _show),
            "chart": run_worlds(worlds, "points", ScanParameters(), folder, pool, _show),
            "chart and body": run_worlds(worlds, "points", ScanParameters(), folder, pool, _show, standard_body()),
        }
    print(f"\n{len(worlds)} scanners; median (largest)")
    baseline = _means(runs["ideal scanner"])
    for name, outcomes in runs.items():
        lengths, ratios = np.abs(_errors(outcomes, "foot_length")), _means(outcomes) / baseline
        silent = sum(len(outcome.silent_errors) for outcome in outcomes)
        print(f"  {name:16} surface {_spread(_means(outcomes))} mm, ratio {_spread(ratios)}")
        print(f"  {'':16} foot length off by {_spread(lengths)} mm, {int(np.sum(lengths > 0.15))} beyond 0.15")
        print(f"  {'':16} errors of foot length", " ".join(f"{e:+.2f}" for e in _errors(outcomes, "foot_length")))
        print(f"  {'':16} silent errors {silent}")


def _means(outcomes: Sequence[WorldOutcome]) -> np.ndarray:
    return np.array([np.nan if outcome.surface is None else outcome.surface.mean for outcome in outcomes])


def _errors(outcomes: Sequence[WorldOutcome], name: str) -> np.ndarray:
    found = [outcome.measures[name].error if name in outcome.measures else None for outcome in outcomes]
    return np.array([np.nan if error is None else error for error in found])


def _spread(values: np.ndarray) -> str:
    return f"{np.nanmedian(values):.3f} ({np.nanmax(values):.3f})"


def _show(outcome: WorldOutcome) -> None:
    print("!" if outcome.problem else ".", end="", flush=True)


if __name__ == "__main__":
    main()

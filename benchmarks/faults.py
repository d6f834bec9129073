"""Single faults of a scanner and of a scan: does what is wrong say so, and does what is right stay `ok`?

    .venv/bin/python -m benchmarks.faults [FIRST COUNT [FOLDER [CASE ...]]]

Each case gives one fault to an ideal scanner (`as_designed`), and measures COUNT feet from stripe points without
pictures. The baseline is the ideal scanner, case `none`. A silent error is a measure that is `ok` and wrong by more
than 0.3 mm and three of its standard deviations. FOLDER keeps what came of each world.
"""

import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from footscan.virtual.worlds.draw import as_designed, draw_assembled
from pipelines.engine.pool import cores, local_cluster
from pipelines.worlds.campaign import run_worlds
from schemas.campaign import WorldOutcome
from schemas.parameters.scan import ScanParameters
from schemas.world import World

FIRST, COUNT = 601, 4
NAMES = ("foot_length", "foot_breadth", "ball_girth")
"""Measures whose status and error are shown."""

Fault = Mapping[str, Any]
"""Part of a world -> what differs there."""

CASES: dict[str, Fault] = {
    "none": {},
    "cameras 1, 2 missing": {"cameras": {"missing": [1, 2]}},
    "cameras 1, 3 missing": {"cameras": {"missing": [1, 3]}},
    "cameras 5, 6 missing": {"cameras": {"missing": [5, 6]}},
    "cameras 5, 7 missing": {"cameras": {"missing": [5, 7]}},
    "camera 3 missing": {"cameras": {"missing": [3]}},
    "glass 1.5 mm higher": {"glass": {"height_mm": 1.5}},
    "glass 1.5 mm lower": {"glass": {"height_mm": -1.5}},
    "glass tilted": {"glass": {"tilt_x_deg": 0.5, "tilt_y_deg": -0.5}},
    "foot moved along": {"subject": {"shift_mm": (2.0, 0.0)}},
    "foot moved across": {"subject": {"shift_mm": (0.0, 2.0)}},
    "foot moved a little": {"subject": {"shift_mm": (0.4, -0.4)}},
    "foot sways": {"subject": {"sway_mm": 1.0}},
    "foot trembles": {"subject": {"tremor_mm": 0.3}},
    "camera 3 knocked": {"cameras": {"knocked": [{"camera": 3, "mm": (0.3, 0.5, -0.4), "turn_deg": (0.2, 0.1, -0.2)}]}},
    "camera 6 knocked": {"cameras": {"knocked": [{"camera": 6, "mm": (0.0, 0.2, 0.2), "turn_deg": (0.0, 0.0, 0.0)}]}},
    "head 2 lost steps": {"heads": (1, {"lost_mm": 1.5})},
    "head 3 1 mm off": {"heads": (2, {"offset_mm": 1.0})},
    "head 1 turned": {"heads": (0, {"yaw_deg": 0.4, "pitch_deg": -0.4})},
    "travel 0.3 % long": {"heads": (0, {"travel_scale": 0.003})},
    "all heads jitter": {"heads": (None, {"jitter_mm": 0.15, "ripple_mm": 0.2})},
    "coarse chart": {"cameras": {"corner_px": 0.3}},
    "steps of 4 mm": {"cameras": {"step_mm": 4.0, "frames": 100}},
    "child": {"subject": {"length_mm": 150.0}},
}


def main() -> None:
    first, count = [int(text) for text in sys.argv[1:3]] or [FIRST, COUNT]
    chosen = sys.argv[4:] or list(CASES)
    with tempfile.TemporaryDirectory() as temporary, local_cluster(cores()) as pool:
        folder = Path(sys.argv[3] if len(sys.argv) > 3 else temporary)
        for name in chosen:
            worlds = [
                with_fault(as_designed(draw_assembled(seed)), CASES[name]) for seed in range(first, first + count)
            ]
            _show(name, run_worlds(worlds, "points", ScanParameters(), folder, pool, lambda _: None))


def with_fault(world: World, fault: Fault) -> World:
    """The world with a fault; of `heads`, that with the given index, or all of them."""
    update: dict[str, Any] = {}
    for part, change in fault.items():
        if part == "heads":
            index, of_head = change
            faulty = range(len(world.heads)) if index is None else (index,)
            update[part] = [
                {**head.model_dump(), **(of_head if n in faulty else {})} for n, head in enumerate(world.heads)
            ]
        else:
            update[part] = {**getattr(world, part).model_dump(), **change}
    return World.model_validate({**world.model_dump(), **update})


def _show(name: str, outcomes: Sequence[WorldOutcome]) -> None:
    silent = [f"{outcome.seed}:{measure}" for outcome in outcomes for measure in outcome.silent_errors]
    ok = [m for outcome in outcomes for m in outcome.measures.values() if m.status == "ok" and m.sigma and m.error]
    ratio = np.abs([m.error / m.sigma for m in ok if m.error is not None and m.sigma])
    within = f"within 1 sd {np.mean(ratio < 1):4.0%}, 3 sd {np.mean(ratio < 3):5.1%}" if len(ratio) else "none ok"
    print(f"{name:22} {len(ok) / sum(len(o.measures) or 1 for o in outcomes):4.0%} ok, {within}, {len(silent)} silent")
    for short in NAMES:
        found = [outcome.measures.get(short) for outcome in outcomes]
        text = [
            f"{m.error:+.2f} ({m.sigma or 0:.2f}{'' if m.status == 'ok' else ' ' + m.status[0]})"
            for m in found
            if m and m.error is not None
        ]
        print(f"    {short:14} {'  '.join(text)}")
    if silent:
        print("    silent:", " ".join(silent))
    for outcome in outcomes[:1]:
        print("    says:", "; ".join(outcome.warnings) or outcome.problem or "nothing")
    sys.stdout.flush()


if __name__ == "__main__":
    main()

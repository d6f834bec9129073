"""Single faults of a scanner and of a scan: does what is wrong say so, and does what is right stay `ok`?

    .venv/bin/python -m benchmarks.faults [FIRST COUNT [FOLDER [CASE ...]]]

Each case gives one fault to an ideal scanner (`as_designed`), and measures COUNT feet from stripe points without
pictures. The baseline is the ideal scanner, case `none`. A silent error is a measure that is `ok` and wrong by more
than 0.3 mm and three of its standard deviations. FOLDER keeps what came of each world.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from footscan.virtual.worlds.draw import as_designed, draw_assembled
from footscan.virtual.worlds.faults import FAULTS, with_fault
from pipelines.engine.pool import cores, local_cluster
from pipelines.worlds.campaign import run_worlds
from schemas.campaign import WorldOutcome
from schemas.parameters.scan import ScanParameters

FIRST, COUNT = 601, 4
NAMES = ("foot_length", "foot_breadth", "ball_girth")
"""Measures whose status and error are shown."""


def main() -> None:
    first, count = [int(text) for text in sys.argv[1:3]] or [FIRST, COUNT]
    chosen = sys.argv[4:] or list(FAULTS)
    with tempfile.TemporaryDirectory() as temporary, local_cluster(cores()) as pool:
        folder = Path(sys.argv[3] if len(sys.argv) > 3 else temporary)
        for name in chosen:
            worlds = [
                with_fault(as_designed(draw_assembled(seed)), FAULTS[name]) for seed in range(first, first + count)
            ]
            _show(name, run_worlds(worlds, "points", ScanParameters(), folder, pool, lambda _: None))


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

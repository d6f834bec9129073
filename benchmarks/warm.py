"""A run that has nothing to do: the whole command beside an empty Python process, and the time of planning.

    .venv/bin/python -m benchmarks.warm [SCAN]

SCAN is the scan of a folder that `footscan demo` made; its results are brought up to date first.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np

from benchmarks.compare import interleave, print_ratios

DEFAULT = Path("demo/archive/P0001/demo-R")
COMMAND = "from pipelines.cli.main import main; main()"
PLANNING = """
import sys, time
from pathlib import Path
from pipelines.archive import job_of_scan, plan_job
job = job_of_scan(*map(Path, sys.argv[1:]))
for _ in range(2):
    start = time.perf_counter()
    planned = plan_job(job)
    print(time.perf_counter() - start, planned.steps, planned.to_run)
"""


def main() -> None:
    scan = Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT
    demo = scan.resolve().parents[2]
    calibration, results = demo / "calibration.json", demo / "results"
    options = ["--scan", str(scan), "--calibration", str(calibration), "--out", str(results)]
    _process("-c", COMMAND, "run", *options)
    runs = {
        "python -c pass": lambda: _process("-c", "pass"),
        "python -c 'import numpy'": lambda: _process("-c", "import numpy"),
        "footscan --help": lambda: _process("-c", COMMAND, "--help"),
        "footscan plan, nothing to do": lambda: _process("-c", COMMAND, "plan", *options),
        "footscan run, nothing to do": lambda: _process("-c", COMMAND, "run", *options),
    }
    print_ratios("Whole processes, wall clock", interleave(runs), 1, "process")
    _print_planning([str(scan), str(calibration), str(results)])


def _process(*arguments: str) -> str:
    return subprocess.run([sys.executable, *arguments], check=True, capture_output=True, text=True).stdout


def _print_planning(arguments: list[str]) -> None:
    rows = np.array([_process("-c", PLANNING, *arguments).split() for _ in range(5)], float)
    steps, first, again = int(rows[0, 1]), 1e3 * np.median(rows[:, 0]), 1e3 * np.median(rows[:, 3])
    print(f"\nPlanning of {steps} steps, {int(rows[0, 2])} of them to run")
    print(f"  {'first in its process (reads the code)':<44}{first:9.1f} ms   {first / steps:.2f} ms a step")
    print(f"  {'again':<44}{again:9.1f} ms   {again / steps:.2f} ms a step")


if __name__ == "__main__":
    main()

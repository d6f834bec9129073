"""What a whole scan costs beside decoding its frames: from films to everything delivered, with an empty cache.

    .venv/bin/python -m benchmarks.cold_scan [SCAN [CALIBRATION]]

Each run is a new process: imports count, compiling does not, for the process before has done that. The baseline decodes
the same films, in memory, on two threads.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from benchmarks.archive import COMMAND
from benchmarks.compare import interleave, print_ratios
from benchmarks.extraction import DEFAULT, THREADS, Packets, load
from footscan.recordings.scans import read_scan

ROUNDS = 5
EARLY = ("foot.stl", "measures.json")
"""Files that a person waits for."""


def main() -> None:
    source = Path(sys.argv[1] if len(sys.argv) > 1 else DEFAULT).resolve()
    calibration = Path(sys.argv[2]) if len(sys.argv) > 2 else source.parents[2] / "calibration.json"
    films = [load(film) for film in map(read_scan(source).film, read_scan(source).document.cameras)]
    with tempfile.TemporaryDirectory() as place:
        scan = Path(place) / "archive" / "patient" / "scan"
        shutil.copytree(source, scan, ignore=shutil.ignore_patterns("frames.zarr"))
        early: list[float] = []
        runs = {
            "decoding alone": partial(decode, films),
            "footscan run": lambda: early.append(_run(scan, calibration.resolve(), Path(place) / "results")),
        }
        seconds = interleave(runs, ROUNDS)
    frames = sum(len(film.frames) for film in films)
    seconds = {**seconds, f"of this, to {' and '.join(EARLY)}": early[1:]}
    print_ratios(f"A cold scan, {len(films)} films, {frames} frames, two threads", seconds, 1, "scan")


def decode(films: list[Packets]) -> None:
    """Decode all frames on two threads."""
    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(lambda film: sum(frame is not None for frame in film.decoded()), films))


def _run(scan: Path, calibration: Path, results: Path) -> float:
    """Reconstruct a scan from its films alone; returns the seconds until the files `EARLY` are there."""
    shutil.rmtree(results, ignore_errors=True)
    shutil.rmtree(scan / "frames.zarr", ignore_errors=True)
    start, early = time.perf_counter(), None
    arguments = ["run", "--scan", str(scan), "--calibration", str(calibration), "--out", str(results)]
    with subprocess.Popen(
        [sys.executable, "-c", COMMAND, *arguments, "--threads", str(THREADS)], stdout=subprocess.DEVNULL
    ) as process:
        while process.poll() is None:
            if early is None and all(any(results.glob(f"*/*/{name}")) for name in EARLY):
                early = time.perf_counter() - start
            time.sleep(0.005)
    if process.returncode:
        raise RuntimeError(f"footscan run ended with {process.returncode}")
    return time.perf_counter() - start if early is None else early


if __name__ == "__main__":
    main()

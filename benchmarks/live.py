"""How long an operator waits: from the heads that stand again to the foot on the page, and to the whole report.

    .venv/bin/python -m benchmarks.live [FOLDER]

A foot is filmed by the virtual scanner, from homing to measures; then what follows the films is repeated from the
stored scan, with nothing in the cache, in this warm process, as in that of the console. The baseline decodes the same
frames, in memory, on two threads. FOLDER keeps scan and pictures.
"""

import datetime
import shutil
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from benchmarks.cold_scan import decode
from benchmarks.compare import interleave, print_ratios
from benchmarks.extraction import Packets, load
from footscan.recordings.scans import read_scan
from pipelines.cli.live.options import StateTeller, opened_rig
from pipelines.live.measuring import measure_scan
from pipelines.live.scan_order import ScanOrder
from pipelines.live.scanner import CHECKING, LiveScanner
from pipelines.live.state import ScannerState
from pipelines.live.storing import ScanName, next_scan_name
from pipelines.live.virtual.world import World

ROUNDS = 5


def main() -> None:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(sys.argv[1] if len(sys.argv) > 1 else temporary).resolve()
        scan, calibration = _film(folder)
        films = [load(film) for film in map(read_scan(scan).film, read_scan(scan).document.cameras)]
        shown: list[float] = []
        runs = {
            "decoding alone": partial(decode, films),
            "from the stored scan to its report": lambda: shown.append(_measure(scan, calibration, folder / "again")),
        }
        seconds = interleave(runs, ROUNDS)
    _print(films, {**seconds, "of this, to the foot on the page": shown[1:]})


def _film(folder: Path) -> tuple[Path, Path]:
    """Film a foot and say how long each activity took; returns the scan and its calibration."""
    began: dict[str, float] = {}

    def note(state: ScannerState) -> None:
        began.setdefault(state.name, time.perf_counter())
        began.setdefault(state.words, time.perf_counter())

    world = World(pictures=str(folder / "pictures"), subject="right")
    today = datetime.datetime.now().astimezone().date()
    with opened_rig(None, folder, world, calibrated=True) as opened, LiveScanner(opened.rig) as scanner:
        scanner.listen(StateTeller())
        scanner.listen(note)
        name = ScanName("P0001", next_scan_name(folder / "archive", "P0001", "right", today), "right", today, "unknown")
        scanner.connect()
        order = ScanOrder(name, folder / "archive", folder / "results")
        result = scanner.scan(order, lambda _: began.setdefault("shown", time.perf_counter()))
        calibration = Path(str(opened.rig.calibration))
    print(f"\nThe heads return and are checked: {began['storing'] - began[CHECKING]:.1f} s")
    print("Seconds after they stand, the first scan of the process")
    for words, end in (("stored", "reconstructing"), ("on the page", "shown"), ("with its report", "done")):
        print(f"  {words:<44}{began[end] - began['storing']:9.1f}")
    return result.stored.place, calibration


def _measure(scan: Path, calibration: Path, results: Path) -> float:
    """Reconstruct and measure a stored scan; returns the seconds until the foot can be shown."""
    shutil.rmtree(results, ignore_errors=True)
    start, shown = time.perf_counter(), []
    measured = measure_scan(scan, calibration, results, lambda _: None, lambda: shown.append(time.perf_counter()))
    if not shown:
        raise RuntimeError(f"{scan}: {measured.problem}")
    return shown[0] - start


def _print(films: list[Packets], seconds: dict[str, list[float]]) -> None:
    frames = sum(len(film.frames) for film in films)
    print_ratios(f"A live scan, {len(films)} films, {frames} frames, two threads", seconds, 1, "scan")


if __name__ == "__main__":
    main()

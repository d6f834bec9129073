"""Timing of a candidate beside a baseline, turn by turn, so that a busy machine slows both."""

import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

ROUNDS = 7


def interleave(
    runs: Mapping[str, Callable[[], object]], rounds: int = ROUNDS, clock: Callable[[], float] = time.perf_counter
) -> dict[str, list[float]]:
    """Seconds that each of `runs` took in each round; every round calls all of them, after one that is not timed.

    The `clock` may be that of the processor time of all threads, `time.process_time`.
    """
    for run in runs.values():
        run()
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            start = clock()
            run()
            seconds[name].append(clock() - start)
    return seconds


def print_ratios(title: str, seconds: Mapping[str, list[float]], calls: int, unit: str) -> None:
    """One line a run: its median time for each of `calls`, and its ratio to the first run, median and spread."""
    print(f"\n{title}")
    baseline = np.array(next(iter(seconds.values())))
    for number, (name, times) in enumerate(seconds.items()):
        each = f"{1e3 * float(np.median(times)) / calls:9.3f} ms a {unit}"
        print(f"  {name:<44}{each}   {'baseline' if number == 0 else ratio_text(np.array(times) / baseline)}")


def ratio_text(ratios: NDArray[np.float64]) -> str:
    """Median and range of the ratios of one round each."""
    return f"{np.median(ratios):6.2f} times the baseline ({ratios.min():.2f} to {ratios.max():.2f})"


def spread(values: Sequence[float], digits: int = 1) -> str:
    """Median and range."""
    return f"{np.median(values):9.{digits}f} ({min(values):.{digits}f} to {max(values):.{digits}f})"


def python(*arguments: str) -> str:
    """What a new process of this Python prints."""
    return subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.PIPE, text=True).stdout

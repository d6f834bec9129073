"""A scan run from its films with an empty cache of its own, in a process of its own: what it takes in time and memory.

Results may come from the cache of the suite, times may not: what is timed is always computed. Each step runs alone, and
before and after it the reference computation, so that a machine that is busy, or slow, slows both. Of several passes
the least counts: the first one also imports libraries and compiles, and what else runs on the machine only adds.
"""

import gc
import os
import shutil
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from multiprocessing import get_context, parent_process
from pathlib import Path
from statistics import fmean
from tempfile import TemporaryDirectory

from footscan.recordings.scans import RecordedScan, read_scan
from pipelines.archive.job import Job, PlannedJob, draw_steps
from pipelines.engine.actions.step import Success
from pipelines.engine.pool import StepEnd, Threads
from pipelines.engine.workspace import Workspace
from pipelines.regression.figures.process_memory import forget_peak, held_mb, peak_mb
from pipelines.regression.figures.reference_computation import reference_seconds
from schemas.base.errors import Fault
from schemas.scan import CameraFilm

TEMPORARY = ".timed-"
"""Begins the name of a folder that a pass has its cache and frames in."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""What tells libraries how many threads to use, read when they are loaded."""


@dataclass(frozen=True)
class StepCost:
    """What one run of a step took."""

    kind: str
    ratio: float
    """Its time as a multiple of the reference computation's."""
    needed_mb: float
    """Memory at most, beyond what was held before."""
    kept_mb: float
    """Memory held after it, beyond what was held before."""


@dataclass(frozen=True)
class Pass:
    """One run of all steps, in their order."""

    steps: Mapping[str, StepCost]
    """By name within the scan, `extract-3`."""
    results: Mapping[str, str]
    """Digests of results by the same name."""
    peak_mb: float
    held_mb: float
    """At the end."""


def take_times(job: Job, passes: int) -> list[Pass]:
    """Run the one scan of a job so many times, in a new process.

    Raises
    ------
    Fault
        The process died.
    RefusedInput
        The scan breaks its format.
    """
    with _one_thread(), ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
        try:
            return process.submit(_passes, job, passes).result()
        except BrokenProcessPool:
            raise Fault(f"{job.folders[0]}: the process that is timed has died; is there memory enough?") from None


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes that are started here keep their libraries to one thread: several that wait for each other, on cores
    that others use, take many times as long as one."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _passes(job: Job, passes: int) -> list[Pass]:
    """The work of that process."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    reference_seconds()  # its material is made, its libraries are loaded
    job.results.mkdir(parents=True, exist_ok=True)
    for left in job.results.glob(f"{TEMPORARY}*"):  # by a night that was killed; there is but one at a time
        shutil.rmtree(left, ignore_errors=True)
    found = []
    for _ in range(passes):
        with TemporaryDirectory(prefix=TEMPORARY, dir=job.results) as empty:
            found.append(_one_pass(job, Path(empty)))
    return found


def _end_with_parent() -> None:
    """A process whose parent was killed would wait for work for ever."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _one_pass(job: Job, empty: Path) -> Pass:
    gc.collect()
    planned = PlannedJob(replace(job, cache=empty / "cache"), Workspace(empty / "cache"))
    [folder] = job.folders
    scan = read_scan(folder, job.archive_of(folder))
    steps = draw_steps(_Elsewhere(scan.folder, scan.archive, scan.document, frames=empty / "frames.zarr"), planned)
    watch = _Watch()
    outcomes = planned.workspace.run(steps, Threads(1), watch.on_step_end)
    planned.workspace.close()
    results = {
        step.name.removeprefix(f"{step.scan}/"): outcome.digest
        for step in steps
        if isinstance(outcome := outcomes[step.name], Success)
    }
    return Pass(watch.steps, results, watch.peak_mb, held_mb())


@dataclass(frozen=True)
class _Elsewhere(RecordedScan):
    """A scan whose frames are ingested into a folder of ours: those beside the films stay as they are."""

    frames: Path = Path()

    def array(self, camera: CameraFilm) -> Path:
        return self.frames / super().array(camera).name

    def background_array(self, camera: CameraFilm) -> Path:
        return self.frames / super().background_array(camera).name


@dataclass
class _Watch:
    """Hears of each step that has ended, and measures the reference between it and the next."""

    steps: dict[str, StepCost] = field(default_factory=dict)
    peak_mb: float = 0.0
    _reference: float = field(default_factory=reference_seconds)
    _held: float = field(default_factory=held_mb)

    def __post_init__(self) -> None:
        forget_peak()

    def on_step_end(self, end: StepEnd) -> None:
        peak, held = peak_mb(), held_mb()
        after = reference_seconds()
        if end.ran:
            self.steps[end.step.name.removeprefix(f"{end.step.scan}/")] = StepCost(
                kind=end.step.kind,
                ratio=end.seconds / fmean([self._reference, after]),
                needed_mb=max(peak - self._held, 0.0),
                kept_mb=held - self._held,
            )
        self.peak_mb = max(self.peak_mb, peak)
        self._reference, self._held = after, held_mb()
        forget_peak()

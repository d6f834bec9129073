"""Time and memory of a scan that runs from its films with an empty cache, in a process of its own.

Results may come from the cache of the suite, times may not: each timed step is computed. The steps run one at a time,
and the reference computation runs before and after each, so that a busy or slow machine slows both. The least of
several passes counts: the first pass also imports libraries and compiles, and other programs only add to a time.
"""

import gc
import os
import shutil
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean
from tempfile import TemporaryDirectory

from footscan.child_process import end_with_parent
from footscan.recordings.scans import RecordedScan, read_scan
from pipelines.archive.job import Job
from pipelines.archive.planning import PlannedJob, draw_steps
from pipelines.engine.actions.step import Success
from pipelines.engine.pool import StepEnd, Threads
from pipelines.engine.workspace import Workspace
from pipelines.regression.figures.process_memory import forget_peak, held_mb, peak_mb
from pipelines.regression.figures.reference_computation import reference_seconds
from schemas.base.errors import Fault
from schemas.scan import CameraFilm

TEMPORARY = ".timed-"
"""Prefix of the folder with the cache and the frames of a pass."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment variables that set the threads of libraries, read when the libraries are loaded."""


@dataclass(frozen=True)
class StepCost:
    """Time and memory of one run of a step."""

    kind: str
    ratio: float
    """Time in units of the reference computation."""
    needed_mb: float
    """Peak of the memory, beyond that held before the step."""
    kept_mb: float
    """Memory held after the step, beyond that held before."""


@dataclass(frozen=True)
class Pass:
    """One run of all steps, in their order."""

    steps: Mapping[str, StepCost]
    """Costs by name of the step within the scan, `extract-3`."""
    results: Mapping[str, str]
    """Digests of the results by the same name."""
    peak_mb: float
    held_mb: float
    """Memory held at the end."""


def take_times(job: Job, passes: int) -> list[Pass]:
    """Run the one scan of a job `passes` times in a new process.

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
            raise Fault(f"{job.folders[0]}: the timed process has died; is there enough memory?") from None


@contextmanager
def _one_thread() -> Iterator[None]:
    """Limit the libraries of processes that are started in the block to one thread.

    Several threads that wait for each other on busy cores take many times as long as one.
    """
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
    """Run the passes, in the new process."""
    end_with_parent()
    reference_seconds()  # makes its material and loads its libraries
    job.results.mkdir(parents=True, exist_ok=True)
    for remnant in job.results.glob(f"{TEMPORARY}*"):  # of a killed night; only one night runs at a time
        shutil.rmtree(remnant, ignore_errors=True)
    timed = []
    for _ in range(passes):
        with TemporaryDirectory(prefix=TEMPORARY, dir=job.results) as empty:
            timed.append(_one_pass(job, Path(empty)))
    return timed


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
    """A scan whose frames are ingested into the folder `frames`; those beside the films stay unchanged."""

    frames: Path = Path()

    def array(self, camera: CameraFilm) -> Path:
        return self.frames / super().array(camera).name

    def background_array(self, camera: CameraFilm) -> Path:
        return self.frames / super().background_array(camera).name


@dataclass
class _Watch:
    """Record the cost of each step that ends, and run the reference computation before the next step."""

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

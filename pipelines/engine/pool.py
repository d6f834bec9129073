"""Pools that run steps: threads of this process, processes of this machine, or workers of a remote Dask cluster.

Tasks pass digests, never arrays; a worker reads and writes the store itself.
"""

import ctypes
import logging
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from multiprocessing import resource_tracker
from typing import Any, Protocol
from uuid import uuid4

from pipelines.engine.actions.step import Failure, Outcome, Step
from pipelines.engine.tls import SCHEME, Certificates, security_of
from schemas.base.errors import RefusedInput, one_line

log = logging.getLogger("footscan.run")

ANSWER_S = 10.0
"""Time to wait for the answer of a scheduler; chosen by hand."""
TRIM_BYTES, MMAP_BYTES = 2**28, 2**25
"""Thresholds of glibc's malloc in worker processes: free memory above the first goes back to the system, arrays above
the second are mapped one by one. With Dask's 64 kB the kernel clears the pages of every array anew, which takes a
quarter of the time of a world. The second is the largest that glibc takes."""
ARENAS, M_ARENA_MAX = 2, -8
"""Heaps that the threads of a process share, and glibc's number of this setting (mallopt(3)). By default each has one,
in which the memory that steps have freed stays: a scan held a quarter more at its peak."""
LOOPBACK = "127.0.0.1"
"""Address of this machine that no other machine can reach (RFC 1122, 3.2.1.3)."""
FAILURES_ALLOWED = 1
"""Workers that a task may kill and still be tried again; chosen by hand."""


@dataclass(frozen=True)
class StepEnd:
    """The end of one step of a run, as listeners receive it."""

    step: Step
    outcome: Outcome
    ran: bool
    """False if the cache had a result for the step's inputs."""
    seconds: float
    earlier_outcome: str | None = None
    """Digest or failure of an earlier run of the same action, if it differs."""
    started: float = 0.0
    """Unix time of its start, by the clock of its machine; 0 if it is not known."""
    worker: str = ""
    """Machine, process and thread that ran it."""
    size: int = 0
    """Bytes of the result, if it ran."""


OnStepEnd = Callable[[StepEnd], None]


@dataclass(frozen=True)
class Task:
    """A step, and the known outcomes of the steps before it."""

    step: Step
    code: str
    """Digest of the step's code on the machine that planned it: a worker may have another version installed."""
    before: Mapping[str, Outcome]
    """Outcomes of steps that are not tasks themselves."""
    waits_for: tuple[str, ...]
    """Names of the tasks that must end before this one starts."""
    is_forced: bool = False
    """True if it runs even if the cache has its result."""


RunTask = Callable[[Task, Mapping[str, StepEnd]], StepEnd]
"""Runs a task; takes also the ends of the tasks that it waited for, by name. It can be pickled."""


class Pool(Protocol):
    """An executor of tasks."""

    @property
    def count(self) -> int:
        """Number of tasks that run at once."""
        ...

    def run(self, tasks: Mapping[str, Task], run_task: RunTask, on_step_end: OnStepEnd) -> dict[str, Outcome]:
        """Run each task after those that it waits for; returns the outcome of each by its name."""
        ...


@dataclass(frozen=True)
class Threads:
    """Threads of this process."""

    count: int
    """Number of steps that run at once."""

    def run(self, tasks: Mapping[str, Task], run_task: RunTask, on_step_end: OnStepEnd) -> dict[str, Outcome]:
        """See `Pool`."""
        # Imported late: it takes time, and a run without misses does not need it.
        import dask
        from dask.threaded import get  # by its name, "threads", Dask would load distributed as well

        def run_and_report(task: Task, ended: Mapping[str, StepEnd]) -> StepEnd:
            end = run_task(task, ended)
            on_step_end(end)
            return end

        _limit_heaps()
        delayed = _delayed(tasks, run_and_report, lambda step: step.name)
        ends = dask.compute(*delayed.values(), scheduler=get, num_workers=self.count)
        return {name: end.outcome for name, end in zip(delayed, ends, strict=True)}


def _limit_heaps() -> None:
    """Let the threads of this process share heaps; does nothing where the C library is not glibc."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if os.name == "posix" else None
    if mallopt is not None:
        mallopt(M_ARENA_MAX, ARENAS)


@dataclass(frozen=True)
class Cluster:
    """Workers of a Dask scheduler, which reach the store and the archive by the same paths."""

    client: Any
    count: int
    """Number of steps that run at once."""
    _memory: dict[str, int] = field(default_factory=dict)
    """Largest memory observed of each worker, bytes, by its address."""

    def run(self, tasks: Mapping[str, Task], run_task: RunTask, on_step_end: OnStepEnd) -> dict[str, Outcome]:
        """See `Pool`."""
        outcomes: dict[str, Outcome] = {}

        def end(ended: StepEnd) -> None:
            outcomes[ended.step.name] = ended.outcome
            on_step_end(ended)

        with self._watching():
            while remaining := {
                name: _with_outcomes(task, outcomes) for name, task in tasks.items() if name not in outcomes
            }:
                suspects = self._run_together(remaining, run_task, end)
                for step, failure in suspects:
                    # All tasks of a worker die with it. A run of each task alone shows which one killed it.
                    alone = {step.name: _with_outcomes(tasks[step.name], outcomes)}
                    if len(suspects) == 1 or self._run_together(alone, run_task, end):
                        end(StepEnd(step, failure, True, 0.0))
        return outcomes

    def _run_together(self, tasks: Mapping[str, Task], run_task: RunTask, end: OnStepEnd) -> list[tuple[Step, Failure]]:
        """Run tasks; returns those that were given up because workers died while they had them."""
        from distributed import KilledWorker, as_completed

        # A scheduler does not run a known key again, so keys differ by run. Its pages group tasks by the first part.
        run = uuid4().hex[:8]
        delayed = _delayed(tasks, run_task, lambda step: (f"{step.kind}-{run}", step.scan, step.camera or 0))
        steps = [tasks[name].step for name in delayed]
        futures = dict(zip(self.client.compute(list(delayed.values())), steps, strict=True))
        suspects = []
        try:
            for future in as_completed(futures):
                step = futures[future]
                try:
                    ended = future.result()  # computed again if its worker died before it was fetched
                except KilledWorker as error:
                    if str(error.task) == str(future.key):  # not a task that only waits for such a task
                        suspects.append((step, self._give_up(step, error)))
                    continue
                except Exception as error:  # an error of Dask; errors of steps are part of the returned StepEnd
                    problem = one_line(f"{step.name}: {type(error).__name__}: {error}")
                    ended = StepEnd(step, Failure(problem, "fault", step.name), True, 0.0)
                end(ended)
        except BaseException:
            self.client.cancel(list(futures))
            raise
        return suspects

    def _give_up(self, step: Step, error: Any) -> Failure:
        peak_bytes = self._memory.get(getattr(error.last_worker, "address", ""), 0)
        held = f", the last one when it held {peak_bytes / 1e6:.0f} MB" if peak_bytes else ""
        problem = f"{step.name}: killed {FAILURES_ALLOWED + 1} workers{held}; given up"
        return Failure(problem, "fault", step.name)

    @contextmanager
    def _watching(self) -> Iterator[None]:
        """Poll the memory of each worker, since a killed worker cannot be asked."""
        done = threading.Event()

        def watch() -> None:
            while not done.wait(0.5):
                try:
                    workers = self.client.scheduler_info(n_workers=-1)["workers"]
                except (OSError, KeyError, TypeError):
                    continue
                for address, worker in workers.items():
                    held = int(worker.get("metrics", {}).get("memory", 0))
                    self._memory[address] = max(held, self._memory.get(address, 0))

        watcher = threading.Thread(target=watch, daemon=True)
        watcher.start()
        try:
            yield
        finally:
            done.set()
            watcher.join()


@contextmanager
def local_cluster(workers: int, *, dashboard: bool = False) -> Iterator[Cluster]:
    """Start worker processes on this machine, each with one step at a time; they listen on the loopback address only.

    `dashboard` : True if Dask's status page is served there.
    """
    import dask

    _quieten()
    from distributed import Client, LocalCluster

    settings = {
        "distributed.scheduler.allowed-failures": FAILURES_ALLOWED,
        # At the end of a run a worker logs an error when its scheduler is gone.
        "distributed.nanny.pre-spawn-environ.DASK_LOGGING__DISTRIBUTED": "critical",
        "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": TRIM_BYTES,
        "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": MMAP_BYTES,
        # Loops that run side by side (footscan.side_by_side) share the cores with the other workers.
        "distributed.nanny.pre-spawn-environ.NUMBA_NUM_THREADS": max(cores() // workers, 1),
    }
    if not dashboard:  # Dask opens the ports of its pages in any case; without routes they serve nothing
        settings |= {"distributed.scheduler.http.routes": [], "distributed.worker.http.routes": []}
    with dask.config.set(settings):
        with _sigint_blocked():
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host=LOOPBACK,
                dashboard_address=f"{LOOPBACK}:0",  # a port alone would listen on all addresses of this machine
                scheduler_kwargs={"dashboard": dashboard},
            )
        with cluster, Client(cluster) as client:
            yield Cluster(client, workers)


@contextmanager
def _sigint_blocked() -> Iterator[None]:
    """Block SIGINT in processes that are started in this context, also by its threads.

    A terminal interrupts all processes of a command. Workers would die in the middle of their communication; the
    process that started them ends them instead.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # started later, it would remove the mask
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def joined_cluster(address: str, certificates: Certificates | None = None) -> Iterator[Cluster]:
    """Join the workers of a running scheduler; RefusedInput if no scheduler answers or it has no workers.

    `certificates` : for an address that begins with `tls://`; default: those of Dask's configuration.
    """
    _quieten()
    from distributed import Client

    security = security_of(certificates) if address.startswith(SCHEME) else None
    try:
        client = Client(address, timeout=ANSWER_S, security=security)
    except (OSError, ValueError, TimeoutError) as error:
        problem = one_line(str(error)) or type(error).__name__
        raise RefusedInput(f"--cluster {address}", f"no Dask scheduler answers ({problem})") from None
    with client:
        threads = sum(client.nthreads().values())
        if not threads:
            raise RefusedInput(f"--cluster {address}", "has no workers, expected at least one that was started before")
        yield Cluster(client, threads)


def _quieten() -> None:
    """Hide log lines of Dask below errors; must be called before `distributed` is imported."""
    import dask

    dask.config.set({"logging": {"distributed": "error", "tornado": "error"}})


def _delayed(tasks: Mapping[str, Task], run_task: RunTask, key: Callable[[Step], Any]) -> dict[str, Any]:
    """Delayed calls of Dask for the tasks; `tasks` is in topological order."""
    import dask

    delayed: dict[str, Any] = {}
    for name, task in tasks.items():
        ended = {waited: delayed[waited] for waited in task.waits_for}
        delayed[name] = dask.delayed(run_task, pure=False)(task, ended, dask_key_name=key(task.step))
    return delayed


def _with_outcomes(task: Task, outcomes: Mapping[str, Outcome]) -> Task:
    """The task with those outcomes of the tasks it waits for that are known by now."""
    known_outcomes = {name: outcomes[name] for name in task.waits_for if name in outcomes}
    waits_for = tuple(name for name in task.waits_for if name not in known_outcomes)
    return replace(task, before={**task.before, **known_outcomes}, waits_for=waits_for)


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

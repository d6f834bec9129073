"""Where steps run: threads of this process, processes of this machine, or workers of a Dask cluster anywhere.

Tasks hand over digests, never arrays; a worker reads and writes the store itself.
"""

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
"""How long a scheduler is waited for."""
LOOPBACK = "127.0.0.1"
FAILURES_ALLOWED = 1
"""A task is tried again after it has killed so many workers; another one, and it is given up."""


@dataclass(frozen=True)
class StepEnd:
    """Told when a step of a run has ended."""

    step: Step
    outcome: Outcome
    ran: bool
    """False where the step's inputs turned out to be those of an earlier run."""
    seconds: float
    otherwise: str | None = None
    """What the same action came to before, where that was another result."""


OnStepEnd = Callable[[StepEnd], None]


@dataclass(frozen=True)
class Task:
    """A step, and what is known of the steps before it."""

    step: Step
    code: str
    """Digest of the step's code where it was planned: elsewhere another version may be installed."""
    before: Mapping[str, Outcome]
    """Outcomes of steps that are not tasks themselves."""
    waits_for: tuple[str, ...]
    """Names of tasks."""


RunTask = Callable[[Task, Mapping[str, StepEnd]], StepEnd]
"""Of a task, and how those that it waited for ended, by name; can be pickled."""


class Pool(Protocol):
    """Something that runs tasks."""

    @property
    def count(self) -> int:
        """How many it runs at once."""
        ...

    def run(self, tasks: Mapping[str, Task], run_task: RunTask, on_step_end: OnStepEnd) -> dict[str, Outcome]:
        """Runs each task after those that it waits for; the outcome of each by its name."""
        ...


@dataclass(frozen=True)
class Threads:
    """Threads of this process."""

    count: int
    """Steps that they run at once."""

    def run(self, tasks: Mapping[str, Task], run_task: RunTask, on_step_end: OnStepEnd) -> dict[str, Outcome]:
        """See `Pool`."""
        import dask  # not needed, and not waited for, when all is there

        def run_and_tell(task: Task, ended: Mapping[str, StepEnd]) -> StepEnd:
            end = run_task(task, ended)
            on_step_end(end)
            return end

        drawn = _draw(tasks, run_and_tell, lambda step: step.name)
        ends = dask.compute(*drawn.values(), scheduler="threads", num_workers=self.count)
        return {name: end.outcome for name, end in zip(drawn, ends, strict=True)}


@dataclass(frozen=True)
class Cluster:
    """Workers of a Dask scheduler, which reach the store and the archive by the same paths."""

    client: Any
    count: int
    """Steps that it runs at once."""
    _memory: dict[str, int] = field(default_factory=dict)
    """The most that each worker was seen to hold, bytes."""

    def run(self, tasks: Mapping[str, Task], run_task: RunTask, on_step_end: OnStepEnd) -> dict[str, Outcome]:
        """See `Pool`."""
        outcomes: dict[str, Outcome] = {}

        def end(ended: StepEnd) -> None:
            outcomes[ended.step.name] = ended.outcome
            on_step_end(ended)

        with self._watching():
            while left := {name: _with(task, outcomes) for name, task in tasks.items() if name not in outcomes}:
                suspects = self._run_together(left, run_task, end)
                for step, failure in suspects:
                    # With a worker all die that it has been given. Who killed it is seen when each runs alone.
                    alone = {step.name: _with(tasks[step.name], outcomes)}
                    if len(suspects) == 1 or self._run_together(alone, run_task, end):
                        end(StepEnd(step, failure, True, 0.0))
        return outcomes

    def _run_together(self, tasks: Mapping[str, Task], run_task: RunTask, end: OnStepEnd) -> list[tuple[Step, Failure]]:
        """Run tasks; those that were given up since workers died of them, or beside them, are returned."""
        from distributed import KilledWorker, as_completed

        # What a scheduler knows by a name, it does not run again; and its pages group tasks by the first part.
        run = uuid4().hex[:8]
        drawn = _draw(tasks, run_task, lambda step: (f"{step.kind}-{run}", step.scan, step.camera or 0))
        steps = [tasks[name].step for name in drawn]
        futures = dict(zip(self.client.compute(list(drawn.values())), steps, strict=True))
        suspects = []
        try:
            for future in as_completed(futures):
                step = futures[future]
                try:
                    ended = future.result()  # which is made again where it died with its worker before it was fetched
                except KilledWorker as error:
                    if str(error.task) == str(future.key):  # not what only waits for such a task
                        suspects.append((step, self._give_up(step, error)))
                    continue
                except Exception as error:  # of Dask's: ours are in what a task returns
                    problem = one_line(f"{step.name}: {type(error).__name__}: {error}")
                    ended = StepEnd(step, Failure(problem, "fault", step.name), True, 0.0)
                end(ended)
        except BaseException:
            self.client.cancel(list(futures))
            raise
        return suspects

    def _give_up(self, step: Step, error: Any) -> Failure:
        most = self._memory.get(getattr(error.last_worker, "address", ""), 0)
        held = f", the last one when it held {most / 1e6:.0f} MB" if most else ""
        problem = f"{step.name}: killed {FAILURES_ALLOWED + 1} workers{held}; given up"
        return Failure(problem, "fault", step.name)

    @contextmanager
    def _watching(self) -> Iterator[None]:
        """Notes how much memory each worker holds: one that was killed cannot be asked."""
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
    """So many processes of this machine, one step at a time in each; they listen on its loopback alone.

    `dashboard` : whether Dask's status page is served there.
    """
    import dask

    _quieten()
    from distributed import Client, LocalCluster

    settings = {
        "distributed.scheduler.allowed-failures": FAILURES_ALLOWED,
        # A worker that misses its scheduler at the end of a run calls it an error.
        "distributed.nanny.pre-spawn-environ.DASK_LOGGING__DISTRIBUTED": "critical",
    }
    if not dashboard:  # Dask opens the ports of its pages in any case; then there is nothing behind them
        settings |= {"distributed.scheduler.http.routes": [], "distributed.worker.http.routes": []}
    with dask.config.set(settings):
        with _deaf_to_ctrl_c():
            here = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host=LOOPBACK,
                dashboard_address=f"{LOOPBACK}:0",  # a name alone, or none, would be all of this machine's addresses
                scheduler_kwargs={"dashboard": dashboard},
            )
        with here, Client(here) as client:
            yield Cluster(client, workers)


@contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    """What is started here, be it by threads that are started here, is not interrupted from the terminal.

    A terminal interrupts all processes of a command. Workers would die of it in the midst of what they say to each
    other; they are ended by the process that started them.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # for it would take the mask off, when the first process is started
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def joined_cluster(address: str, certificates: Certificates | None = None) -> Iterator[Cluster]:
    """The workers of a scheduler that was started elsewhere; RefusedInput where none answers.

    `certificates` : for an address that begins with `tls://`; default: those of Dask's own configuration.
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
            raise RefusedInput(f"--cluster {address}", "has no workers, expected some that were started before")
        yield Cluster(client, threads)


def _quieten() -> None:
    """What Dask's parts say to each other is none of a person's business; it is set before they are imported."""
    import dask

    dask.config.set({"logging": {"distributed": "error", "tornado": "error"}})


def _draw(tasks: Mapping[str, Task], run_task: RunTask, key: Callable[[Step], Any]) -> dict[str, Any]:
    """The tasks as Dask's, each after those that it waits for, as they are given."""
    import dask

    drawn: dict[str, Any] = {}
    for name, task in tasks.items():
        ended = {waited: drawn[waited] for waited in task.waits_for}
        drawn[name] = dask.delayed(run_task, pure=False)(task, ended, dask_key_name=key(task.step))
    return drawn


def _with(task: Task, outcomes: Mapping[str, Outcome]) -> Task:
    """The task, with what has become known of those that it waits for."""
    known = {name: outcomes[name] for name in task.waits_for if name in outcomes}
    waits_for = tuple(name for name in task.waits_for if name not in known)
    return replace(task, before={**task.before, **known}, waits_for=waits_for)


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

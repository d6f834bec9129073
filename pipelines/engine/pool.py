"""Where steps run: threads of this process, processes of this machine, or workers of a Dask cluster anywhere.

Tasks hand over digests, never arrays; a worker reads and writes the store itself.
"""

import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Protocol
from uuid import uuid4

from pipelines.engine.step import Failure, Outcome, Step
from schemas.errors import RefusedInput, one_line

log = logging.getLogger("footscan.run")

ANSWER_S = 10.0
"""How long a scheduler is waited for."""
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
        from distributed import as_completed

        # What a scheduler knows by a name, it does not run again; and its pages group tasks by the first part.
        run = uuid4().hex[:8]
        drawn = _draw(tasks, run_task, lambda step: (f"{step.kind}-{run}", step.scan, step.camera or 0))
        names = list(drawn)
        futures = dict(zip(self.client.compute(list(drawn.values())), names, strict=True))
        outcomes: dict[str, Outcome] = {}
        try:
            with self._watching():
                for future in as_completed(futures):
                    name = futures[future]
                    outcomes[name] = self._end(tasks[name].step, future, on_step_end)
        except BaseException:
            self.client.cancel(list(futures))
            raise
        return outcomes

    def _end(self, step: Step, future: Any, on_step_end: OnStepEnd) -> Outcome:
        if future.status == "finished":
            end: StepEnd = future.result()
        else:
            end = StepEnd(step, self._explain(step, future.exception()), True, 0.0)
        on_step_end(end)
        return end.outcome

    def _explain(self, step: Step, error: BaseException | None) -> Failure:
        """Why a task has no result at all: its worker died, or that of one before it."""
        from distributed import KilledWorker

        if not isinstance(error, KilledWorker):
            return Failure(one_line(f"{step.name}: {type(error).__name__}: {error}"), "fault", step.name)
        (kind, *_), scan, camera = _parts(error.task)
        cause = f"{scan}/{kind}" + (f"-{camera}" if camera else "")
        most = self._memory.get(getattr(error.last_worker, "address", ""), 0)
        held = f", the last one when it held {most / 1e6:.0f} MB" if most else ""
        problem = f"{cause}: killed {FAILURES_ALLOWED + 1} workers{held}; given up"
        return Failure(problem, "fault", cause)

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
def local_cluster(workers: int) -> Iterator[Cluster]:
    """So many processes of this machine, one step at a time in each."""
    import dask

    _quieten()
    from distributed import Client, LocalCluster

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": FAILURES_ALLOWED}),
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0") as here,
        Client(here) as client,
    ):
        yield Cluster(client, workers)


@contextmanager
def joined_cluster(address: str) -> Iterator[Cluster]:
    """The workers of a scheduler that was started elsewhere; RefusedInput where none answers."""
    _quieten()
    from distributed import Client

    try:
        client = Client(address, timeout=ANSWER_S)
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


def _parts(key: Any) -> tuple[list[str], str, int]:
    """Kind (and run), scan and camera of a task's key, as Dask gives it back."""
    import ast

    name, scan, camera = ast.literal_eval(key) if isinstance(key, str) else key
    return str(name).rsplit("-", 1), str(scan), int(camera)

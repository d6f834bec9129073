"""Where the steps of a command run: its options `--threads`, `--workers` and `--cluster`."""

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.output import message
from schemas.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.engine.pool import OnStepEnd, Pool, RunTask, Task
    from pipelines.engine.step import Outcome

Threads = Annotated[
    int | None, typer.Option("--threads", min=1, help="Steps that run at once; as many as cores where absent.")
]
Workers = Annotated[
    int | None, typer.Option("--workers", min=1, help="Run the steps in so many processes of this machine instead.")
]
ClusterAddress = Annotated[
    str | None, typer.Option("--cluster", metavar="ADDRESS", help="Run them on the workers of this Dask scheduler.")
]


def check_workers(threads: int | None, workers: int | None, cluster: str | None) -> None:
    """Refuse options that contradict each other, before anything is read."""
    if sum(given is not None for given in (threads, workers, cluster)) > 1:
        raise RefusedInput("--threads, --workers, --cluster", "exclude each other, expected one of them")
    if cluster == "":
        raise RefusedInput("--cluster", "expected the address of a Dask scheduler, such as tcp://one:8786, found ''")


@contextmanager
def chosen_pool(threads: int, workers: int | None, cluster: str | None) -> "Iterator[Pool]":
    """The pool of `--workers` or `--cluster`, otherwise so many threads."""
    from pipelines.engine.pool import Threads as ThreadPool

    if workers is None and cluster is None:
        yield ThreadPool(threads)
        return
    with ExitStack() as stack:
        yield _LazyCluster(stack, workers or threads, cluster)


class _LazyCluster:
    """A cluster that is opened when there is something to run, for it takes seconds to start."""

    def __init__(self, stack: ExitStack, workers: int, address: str | None) -> None:
        self._stack, self._workers, self._address = stack, workers, address
        self._cluster: Pool | None = None

    @property
    def count(self) -> int:
        """Steps that run at once; of a scheduler that has not been asked yet, a guess."""
        return self._cluster.count if self._cluster else self._workers

    def run(self, tasks: "Mapping[str, Task]", run_task: "RunTask", on_step_end: "OnStepEnd") -> "dict[str, Outcome]":
        """See `Pool`."""
        from pipelines.engine.pool import joined_cluster, local_cluster

        if self._cluster is None:
            opening = joined_cluster(self._address) if self._address else local_cluster(self._workers)
            cluster = self._stack.enter_context(opening)
            message(f"dashboard: {cluster.client.dashboard_link}")
            self._cluster = cluster
        return self._cluster.run(tasks, run_task, on_step_end)

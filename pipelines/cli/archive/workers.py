"""Options that say where steps run: `--threads`, `--workers` and `--cluster`."""

from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.terminal.output import message
from schemas.base.errors import RefusedInput

if TYPE_CHECKING:
    from pipelines.engine.actions.step import Outcome
    from pipelines.engine.pool import Cluster, OnStepEnd, Pool, RunTask, Task

Threads = Annotated[
    int | None, typer.Option("--threads", min=1, help="Number of steps that run at once; default: number of cores.")
]
Workers = Annotated[
    int | None,
    typer.Option(
        "--workers", min=1, help="Number of local processes that run the steps; default: threads of one process."
    ),
]
ClusterAddress = Annotated[
    str | None,
    typer.Option("--cluster", metavar="ADDRESS", help="Run the steps on the workers of this Dask scheduler."),
]
Dashboard = Annotated[bool, typer.Option("--dashboard", help="With --workers: serve Dask's dashboard on this machine.")]
TlsCa = Annotated[
    Path | None, typer.Option("--tls-ca", help="Certificate of the authority, for --cluster tls://... (PEM).")
]
TlsCert = Annotated[Path | None, typer.Option("--tls-cert", help="Client certificate, for --cluster tls://... (PEM).")]
TlsKey = Annotated[
    Path | None, typer.Option("--tls-key", help="Private key of the client certificate, without a password (PEM).")
]


@dataclass(frozen=True)
class Placement:
    """Values of these options."""

    threads: int | None
    workers: int | None
    cluster: str | None
    dashboard: bool = False
    tls: tuple[Path | None, Path | None, Path | None] = (None, None, None)
    """Files of the authority's certificate, the client certificate and its key."""

    def check(self) -> None:
        """Refuse options that contradict each other, before anything is read."""
        if sum(given is not None for given in (self.threads, self.workers, self.cluster)) > 1:
            raise RefusedInput("--threads, --workers, --cluster", "exclude each other, expected one of them")
        if self.cluster == "":
            expected = "expected the address of a Dask scheduler, such as tcp://one:8786, found ''"
            raise RefusedInput("--cluster", expected)
        if self.dashboard and self.workers is None:
            raise RefusedInput("--dashboard", "goes with --workers; a scheduler elsewhere has a page of its own")
        if any(self.tls) and not (self.cluster or "").startswith("tls://"):
            raise RefusedInput("--tls-ca, --tls-cert, --tls-key", "go with --cluster tls://ADDRESS")
        if any(self.tls) and not all(self.tls):
            raise RefusedInput("--tls-ca, --tls-cert, --tls-key", "belong together, expected all three")


@contextmanager
def chosen_pool(threads: int, placement: Placement) -> "Iterator[Pool]":
    """The pool of `--workers` or `--cluster`; default: threads."""
    from pipelines.engine.pool import Threads as ThreadPool

    if placement.workers is None and placement.cluster is None:
        yield ThreadPool(threads)
        return
    with ExitStack() as stack:
        yield _LazyCluster(stack, placement.workers or threads, placement)


class _LazyCluster:
    """A cluster that is opened on the first run, because it takes seconds to start."""

    def __init__(self, stack: ExitStack, workers: int, placement: Placement) -> None:
        self._stack, self._workers, self._placement = stack, workers, placement
        self._cluster: Pool | None = None

    @property
    def count(self) -> int:
        """Number of steps that run at once; a guess until the scheduler has answered."""
        return self._cluster.count if self._cluster else self._workers

    def run(self, tasks: "Mapping[str, Task]", run_task: "RunTask", on_step_end: "OnStepEnd") -> "dict[str, Outcome]":
        """See `Pool`."""
        if self._cluster is None:
            cluster = self._stack.enter_context(self._opening())
            if self._placement.dashboard or self._placement.cluster:
                message(f"dashboard: {cluster.client.dashboard_link}")
            self._cluster = cluster
        return self._cluster.run(tasks, run_task, on_step_end)

    def _opening(self) -> "AbstractContextManager[Cluster]":
        from pipelines.engine.pool import joined_cluster, local_cluster
        from pipelines.engine.tls import Certificates

        if self._placement.cluster is None:
            return local_cluster(self._workers, dashboard=self._placement.dashboard)
        ca, cert, key = self._placement.tls
        certificates = Certificates(ca, cert, key) if ca and cert and key else None
        return joined_cluster(self._placement.cluster, certificates)

"""A progress bar on standard error, fed by the events of a run."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from pipelines.engine.run import StepEnd


@contextmanager
def frame_progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """A bar of frames done and frames in all, for what is not a run of steps."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what)
        yield lambda done, total: bar.update(task, completed=done, total=total)


class StepProgress:
    """Counts steps as they end; draws a bar where standard error is a terminal."""

    def __init__(self, to_run: int) -> None:
        self.ran = 0
        """Steps that ran, those left out that turned out to be known."""
        self.seconds: dict[str, float] = {}
        """Time taken by each kind of step, summed over cameras and scans."""
        self._lock = threading.Lock()
        console = Console(stderr=True)
        self._bar = Progress(
            TextColumn("{task.description:<24}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=not to_run or not console.is_terminal,
        )
        self._task = self._bar.add_task("", total=to_run)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._bar.stop()

    def on_step_end(self, end: StepEnd) -> None:
        """Hears that a step has ended."""
        with self._lock:
            self.ran += end.ran
            self.seconds[end.step.kind] = self.seconds.get(end.step.kind, 0.0) + end.seconds
            self._bar.update(self._task, advance=1, description=end.step.name.rpartition("/")[2])

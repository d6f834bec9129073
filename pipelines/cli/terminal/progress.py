"""A progress bar on standard error, driven by the events of a run."""

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TextIO

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from pipelines.cli.terminal.output import is_quiet, json_text
from pipelines.engine.actions.step import Failure
from pipelines.engine.pool import StepEnd

if TYPE_CHECKING:
    from pipelines.archive.running import ScanEnd


@contextmanager
def frame_progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar of frames, for work that is not a run of steps."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=is_quiet() or not console.is_terminal) as bar:
        task = bar.add_task(what)
        yield lambda done, total: bar.update(task, completed=done, total=total)


class StepProgress:
    """Counts the steps and scans of a run as they end; draws a line where standard error is a terminal."""

    def __init__(self, to_run: int | None, scans: int = 0, log: TextIO | None = None) -> None:
        """`to_run` : number of steps; None if it is not known, and the line then shows how many have ended."""
        self.ran = 0
        """Steps that ran, without those whose result was found in the store."""
        self.seconds: dict[str, float] = {}
        """Seconds taken by each kind of step, summed over cameras and scans."""
        self._scans, self._done, self._failed, self._cached = scans, 0, 0, 0
        self._frames, self._start = 0, time.monotonic()
        self._log = log
        self._lock = threading.Lock()
        console = Console(stderr=True)
        self._bar = Progress(
            TextColumn("{task.description:<24}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=is_quiet() or to_run == 0 or not console.is_terminal,
        )
        self._task = self._bar.add_task("", total=to_run)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._bar.stop()

    def on_step_end(self, end: StepEnd) -> None:
        """Count a step that has ended."""
        failure = end.outcome.problem if isinstance(end.outcome, Failure) else None
        with self._lock:
            self.ran += end.ran
            self.seconds[end.step.kind] = self.seconds.get(end.step.kind, 0.0) + end.seconds
            self._frames += _frames(end)
            self._bar.update(self._task, advance=1, description=self._line(end.step.name.rpartition("/")[2]))
            self._write(
                "step", scan=end.step.scan, step=end.step.kind, camera=end.step.camera, ran=end.ran,
                seconds=round(end.seconds, 6), problem=failure, otherwise=end.earlier_outcome,
            )  # fmt: skip

    def on_scan_end(self, end: "ScanEnd") -> None:
        """Count a scan that has ended."""
        with self._lock:
            self._done += end.problem is None
            self._failed += end.problem is not None
            self._cached += end.was_cached
            folder = None if end.folder is None else str(end.folder)
            self._write(
                "scan",
                scan=end.scan,
                status=end.kind or "done",
                known=end.was_cached,
                results=folder,
                problem=end.problem,
            )

    def _line(self, step: str) -> str:
        if self._scans < 2:
            return step
        rate = self._frames / max(time.monotonic() - self._start, 1e-3)
        ended = self._done + self._failed
        return (
            f"{ended} of {self._scans} scans ({self._failed} failed, {self._cached} known), {rate:.0f} frames/s: {step}"
        )

    def _write(self, event: str, **facts: Any) -> None:
        if self._log is not None:
            self._log.write(json_text({"event": event, "time": time.time(), **facts}) + "\n")
            self._log.flush()


def _frames(end: StepEnd) -> int:
    """Number of frames in which a step searched the stripe."""
    if not end.ran or end.step.kind != "extract":
        return 0
    try:
        return int(json.loads((end.step.places["array"] / "zarr.json").read_bytes())["shape"][0])
    except (OSError, ValueError, KeyError, IndexError, TypeError):
        return 0

"""Delivery of what a person waits for, before the rest of a scan is done."""

import logging
import threading
from collections.abc import Mapping
from pathlib import Path

from pipelines.engine.actions.step import Success
from pipelines.engine.pool import StepEnd
from pipelines.engine.workspace import Workspace
from pipelines.scan import DELIVERABLE

log = logging.getLogger("footscan.archive")

MEASURES = "measures.json"
LAST = "report.html"
"""The file that is there once all are."""


class EarlyDelivery:
    """Delivers each file as soon as its step has ended, and the measures are there, of scans without results.

    A scan that cannot be measured leaves nothing. A scan with earlier results gets new ones all at once: a report must
    not lie beside measures of another run.

    Parameters
    ----------
    folders : the folder of the results of each scan, by its name
    known : digests of the files whose steps need not run, by scan and file name
    """

    def __init__(
        self, workspace: Workspace, folders: Mapping[str, Path], known: Mapping[str, Mapping[str, str]]
    ) -> None:
        self._workspace = workspace
        self._folders = {scan: folder for scan, folder in folders.items() if not folder.exists()}
        self._waiting = {scan: dict(known[scan]) for scan in self._folders}
        self._measured = {scan for scan in self._folders if MEASURES in known[scan]}
        self._lock = threading.Lock()
        for scan in self._measured:
            self._deliver(scan)

    def on_step_end(self, end: StepEnd) -> None:
        """Deliver the file that the step made, if any; from any thread."""
        if end.step.scan in self._folders and isinstance(end.outcome, Success):
            made = [file for file, kind in DELIVERABLE.items() if kind == end.step.kind]
            with self._lock:
                self._waiting[end.step.scan] |= dict.fromkeys(made, end.outcome.digest)
                if MEASURES in made:
                    self._measured.add(end.step.scan)
                self._deliver(end.step.scan)

    def _deliver(self, scan: str) -> None:
        if scan in self._measured:
            problem = self._workspace.deliver(self._waiting[scan], self._folders[scan])
            self._waiting[scan].clear()
            if problem is not None:  # reported at the end of the scan, if it still is one
                log.debug("%s", problem)


def older_results(folder: Path) -> str:
    """Warning if a failed scan still has results of an earlier run; empty without."""
    return f" ({folder} still holds the results of an earlier run)" if (folder / LAST).exists() else ""

"""Delivery of what a person waits for, before the rest of a scan is done."""

import logging
from collections.abc import Mapping
from pathlib import Path

from pipelines.engine.actions.step import Success
from pipelines.engine.pool import StepEnd
from pipelines.engine.workspace import Workspace
from pipelines.scan import DELIVERED

log = logging.getLogger("footscan.archive")

LAST = "report.html"
"""The file that is there once all are."""


class EarlyDelivery:
    """Delivers each file as soon as its step has ended, of scans that have no results yet.

    A scan with earlier results gets new ones all at once: a report must not lie beside measures of another run.

    Parameters
    ----------
    folders : the folder of the results of each scan, by its name
    """

    def __init__(self, workspace: Workspace, folders: Mapping[str, Path]) -> None:
        self._workspace = workspace
        self._folders = {scan: folder for scan, folder in folders.items() if not folder.exists()}

    def on_step_end(self, end: StepEnd) -> None:
        """Deliver the file that the step made, if any."""
        folder = self._folders.get(end.step.scan)
        if folder is None or not isinstance(end.outcome, Success):
            return
        made = {file: end.outcome.digest for file, kind in DELIVERED.items() if kind == end.step.kind}
        problem = self._workspace.deliver(made, folder)
        if problem is not None:  # reported at the end of the scan, if it still is one
            log.debug("%s", problem)


def older_results(folder: Path) -> str:
    """Warning if a failed scan still has results of an earlier run; empty without."""
    return f" ({folder} still holds the results of an earlier run)" if (folder / LAST).exists() else ""

"""Delivery of what a person waits for, before the rest of a scan is done."""

import logging
from collections.abc import Mapping
from pathlib import Path

from pipelines.engine.actions.step import Success
from pipelines.engine.pool import StepEnd
from pipelines.engine.workspace import Workspace
from pipelines.scan import DELIVERED

log = logging.getLogger("footscan.archive")

EARLY = ("foot.stl", "measures.json")
"""Files of the results that do not wait for verification and report."""
LAST = "report.html"
"""The file that is there once all are."""


class EarlyDelivery:
    """Delivers the files `EARLY` as soon as all of their steps have ended, of scans that have no results yet.

    A scan with earlier results gets new ones all at once: a report must not stand beside measures of another run.

    Parameters
    ----------
    folders : the folder of the results of each scan, by its name
    """

    def __init__(self, workspace: Workspace, folders: Mapping[str, Path]) -> None:
        self._workspace = workspace
        self._folders = {scan: folder for scan, folder in folders.items() if not folder.exists()}
        self._made: dict[str, dict[str, str]] = {scan: {} for scan in self._folders}

    def on_step_end(self, end: StepEnd) -> None:
        """Deliver the files, if the step was the last of them."""
        made = self._made.get(end.step.scan)
        files = [file for file in EARLY if DELIVERED[file] == end.step.kind]
        if made is None or not files or not isinstance(end.outcome, Success):
            return
        made |= dict.fromkeys(files, end.outcome.digest)
        if len(made) < len(EARLY):
            return
        problem = self._workspace.deliver(made, self._folders[end.step.scan])
        if problem is not None:  # reported at the end of the scan, if it still is one
            log.debug("%s", problem)


def older_results(folder: Path) -> str:
    """Warning if a failed scan still has results of an earlier run; empty without."""
    return f" ({folder} still holds the results of an earlier run)" if (folder / LAST).exists() else ""

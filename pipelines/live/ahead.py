"""Reconstruction of a scan while its heads still return: the operator waits less when they stand."""

import logging
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from footscan.recordings.scans import RecordedScan
from pipelines.archive.job import job_of_scan
from pipelines.archive.planning import PlannedJob, draw_steps, workspace_of
from pipelines.engine.actions.step import Failure, steps_to
from pipelines.engine.pool import Threads
from schemas.base.errors import FootscanError
from schemas.scan import Scan

log = logging.getLogger("footscan.live")

KINDS = ("map", "colour", "heads", "clean", "fuse", "surface", "measure")
"""Kinds of steps, the last of each turn; between two turns it may end."""


@contextmanager
def measuring_ahead(folder: Path, document: Scan, calibration: Path | None, results: Path | None) -> Iterator[None]:
    """Reconstruct and measure a scan beside the block; when that ends, no further turn begins.

    The scan in `folder` needs no scan.yaml yet, and may have another place later: results are found by their content.
    A failure counts for nothing here, as it comes again when the scan is measured. Without calibration, or without a
    place for results, nothing is done.
    """
    if calibration is None or results is None:
        yield
        return
    scan = RecordedScan(folder.resolve(), folder.resolve().parent.parent, document)
    ending = threading.Event()
    with ThreadPoolExecutor(1, "measuring ahead") as thread:
        work = thread.submit(_measure, scan, calibration, results, ending)
        try:
            yield
        finally:
            ending.set()
    if (error := work.exception()) is not None:
        log.debug("%s: %s", scan.name, error, exc_info=None if isinstance(error, FootscanError) else error)


def _measure(scan: RecordedScan, calibration: Path, results: Path, ending: threading.Event) -> None:
    job = job_of_scan(scan.folder, calibration, results)
    with workspace_of(job) as workspace, workspace.lease():
        steps = draw_steps(scan, PlannedJob(job, workspace))
        for kind in KINDS:
            if ending.is_set():
                return
            turn = steps_to(steps, [step.name for step in steps if step.kind == kind])
            outcomes = workspace.run(turn, Threads(job.threads), lambda _: None)
            if any(isinstance(outcome, Failure) for outcome in outcomes.values()):
                return

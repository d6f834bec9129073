"""Measurement of a new scan by the same dataflow as `footscan run --scan`."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipelines.archive.job import job_of_scan
from pipelines.archive.planning import plan_job
from pipelines.archive.running import run_job
from pipelines.engine.actions.step import Success
from pipelines.engine.pool import StepEnd, Threads
from pipelines.scan import DELIVERED, SHOWN
from schemas.base.errors import Fault
from schemas.measures import Measures


@dataclass(frozen=True)
class Measured:
    """The outcome of measuring a scan."""

    folder: Path | None
    """Folder of the results; None without results."""
    measures: Measures | None
    problem: str | None
    kind: str | None
    """Kind of the problem: `refused`, `finding`, `fault` or `damaged`, as in `ScanEnd`."""
    warnings: Sequence[str] = ()
    """All that speaks against the measures, as in `ScanEnd`."""


def measure_scan(
    scan: Path,
    calibration: Path,
    results: Path,
    on_progress: Callable[[float], None],
    on_shown: Callable[[], None] = lambda: None,
) -> Measured:
    """Reconstruct and measure a scan folder.

    Parameters
    ----------
    on_progress : is called with the share of the steps that have ended.
    on_shown : is called when the foot can be shown, before its report is written; never if a step has failed.
    """
    planned = plan_job(job_of_scan(scan, calibration, results), reasons=True)
    missing = {DELIVERED[file] for file in SHOWN} & {step.kind for step in planned.waiting}
    ended = 0
    lock = threading.Lock()

    def on_step_end(end: StepEnd) -> None:
        nonlocal ended
        with lock:
            ended += 1
            on_progress(ended / max(planned.to_run, 1))
            if end.step.kind in missing and isinstance(end.outcome, Success):
                missing.remove(end.step.kind)
                if not missing:
                    on_shown()

    for end in run_job(planned, Threads(planned.job.threads), on_step_end):
        measures = None
        if end.folder is not None:
            measures = Measures.model_validate_json((end.folder / "measures.json").read_bytes())
        return Measured(end.folder, measures, end.problem, end.kind, end.warnings)
    raise Fault(f"{scan}: the run ended without a result")

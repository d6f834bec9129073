"""A new scan through the usual dataflow, as `footscan run --scan` takes it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pipelines.archive.job import job_of_scan, plan_job, run_job
from pipelines.engine.pool import StepEnd, Threads
from schemas.base.errors import Fault
from schemas.measures import Measures


@dataclass(frozen=True)
class Measured:
    """What became of a scan."""

    folder: Path | None
    """Its results; None where it has none."""
    measures: Measures | None
    problem: str | None
    kind: str | None
    """`refused`, `finding`, `fault` or `damaged`, as in `ScanEnd`."""


def measure_scan(scan: Path, calibration: Path, results: Path, on_progress: Callable[[float], None]) -> Measured:
    """Reconstructs and measures a scan folder; `on_progress` hears the share of the steps that have ended."""
    planned = plan_job(job_of_scan(scan, calibration, results))
    ended = 0

    def on_step_end(_: StepEnd) -> None:
        nonlocal ended
        ended += 1
        on_progress(ended / max(planned.to_run, 1))

    for end in run_job(planned, Threads(planned.job.threads), on_step_end):
        measures = None
        if end.folder is not None:
            measures = Measures.model_validate_json((end.folder / "measures.json").read_bytes())
        return Measured(end.folder, measures, end.problem, end.kind)
    raise Fault(f"{scan}: nothing became of it")

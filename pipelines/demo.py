"""The demo: film one foot, calibrate, reconstruct, measure, and compare the result with the known foot."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from footscan.recordings.scans import SCAN_FILE, scan_folders
from pipelines.archive.job import CACHE, Job
from pipelines.archive.planning import plan_job
from pipelines.archive.running import run_job
from pipelines.engine.actions.step import Step
from pipelines.engine.pool import OnStepEnd, Threads, cores
from pipelines.engine.workspace import Workspace, digests_by_kind
from pipelines.recordings.calibration_choice import CalibrationPlace
from pipelines.scan import STEPS
from pipelines.simulate import filmed_calibration_steps
from schemas.base.errors import Fault
from schemas.parameters.demo import FilmedFoot
from schemas.parameters.scan import ScanParameters

Watch = Callable[[str, int, int], AbstractContextManager[OnStepEnd]]
"""Called with a part's name, its number of steps to run and of all steps; returns the listener for their ends."""


@dataclass
class DemoResult:
    """The results of the demo."""

    results: Path
    """Folder of the scan's results."""
    true_measures: dict[str, float]
    """The foot's true measures by name."""
    seconds: dict[str, float] = field(default_factory=dict)
    """Time taken by each part."""


def run_demo(folder: Path, foot: FilmedFoot, watch: Watch) -> DemoResult:
    """Film a parametric foot and the reference object, calibrate, and reconstruct the scan; finished parts are kept.

    Raises
    ------
    Fault
        The demo could not be run to its end.
    """
    results = folder / "results"
    seconds: dict[str, float] = {}

    @contextmanager
    def timed(part: str, to_run: int, steps: int) -> Iterator[OnStepEnd]:
        start = time.perf_counter()
        with watch(part, to_run, steps) as on_step_end:
            yield on_step_end
        seconds[part] = time.perf_counter() - start

    filming = _filming(folder, foot)
    with Workspace(results / CACHE) as workspace:
        plan = workspace.plan(filming)
        with timed("filming and calibration", len(plan.to_run), len(plan.steps)) as on_step_end, workspace.lease():
            outcomes = workspace.run(filming, Threads(1), on_step_end)
        digests = digests_by_kind(filming, outcomes)
        files = {"calibration.json": digests["calibrate"], "known.json": digests["film"]}
        if problem := workspace.deliver(files, folder):
            raise Fault(problem)

    planned = plan_job(_job(folder, results))
    with timed("reconstruction", planned.to_run, planned.steps) as on_step_end:
        ends = list(run_job(planned, Threads(planned.job.threads), on_step_end))
    for end in ends:
        if end.problem is not None:
            raise Fault(f"{end.scan}: {end.problem}")
    true_measures = json.loads((folder / "known.json").read_bytes())
    return DemoResult(results / foot.patient / foot.scan, true_measures, seconds)


def _filming(folder: Path, foot: FilmedFoot) -> list[Step]:
    scan = folder / "archive" / foot.patient / foot.scan
    capture = folder / "capture"
    film = Step("demo", "film", f"{STEPS}.simulate_scan", foot, places={"folder": scan}, writes=scan / SCAN_FILE)
    ordinary_light = foot.settings.model_copy(update={"ambient": "ambient"})  # a scanner is calibrated once
    return [film, *filmed_calibration_steps("demo", capture, ordinary_light)]


def _job(folder: Path, results: Path) -> Job:
    """The same job as that of the project's workflow.yaml."""
    archive = folder / "archive"
    return Job(
        folders=list(scan_folders(archive)),
        archives=(archive,),
        calibrations=(CalibrationPlace(folder / "calibration.json"),),
        calibration_wins=False,
        results=results,
        cache=results / CACHE,
        parameters=ScanParameters(),
        threads=cores(),
    )

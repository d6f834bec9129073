"""Fixtures with a small archive that can be planned and run."""

import shutil
from pathlib import Path

import pytest
import yaml

from footscan.virtual.filming.capture import record_capture
from footscan.virtual.stage.reference import standard_reference
from pipelines.archive.job import Job, job_of_workflow
from pipelines.archive.planning import plan_job
from pipelines.archive.running import ScanEnd, run_job
from pipelines.engine.pool import StepEnd, Threads
from schemas.parameters.simulation import SimulationSettings


class Archive:
    """An archive with its workflow."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.scan = root / "archive/P0001/S1"
        self.results = root / "results/P0001/S1"
        self.workflow = root / "workflow.yaml"

    def job(self) -> Job:
        return job_of_workflow(self.workflow)

    def plan(self) -> tuple[int, dict[str, str]]:
        """Number of steps, and the reason of each step to run by its name within the scan."""
        planned = plan_job(self.job(), reasons=True)
        assert planned.refused == []
        reasons = {w.name.removeprefix("P0001/S1/"): w.reason for w in planned.waiting}
        return planned.steps, reasons

    def run(self) -> tuple[list[ScanEnd], set[str]]:
        """The ends of the scans, and the names of the steps that ran."""
        ends: list[StepEnd] = []
        scans = list(run_job(plan_job(self.job()), Threads(2), ends.append))
        return scans, {end.step.name.removeprefix("P0001/S1/") for end in ends if end.ran}

    def set_parameters(self, parameters: str) -> None:
        before = self.workflow.read_text().partition("parameters:")[0]
        self.workflow.write_text(f"{before}parameters: {parameters}\n")


@pytest.fixture(scope="session")
def finished(pristine: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("finished") / "home"
    shutil.copytree(pristine, root)
    scans, _ = Archive(root).run()
    assert [(scan.scan, scan.problem) for scan in scans] == [("P0001/S1", None)]
    return root


@pytest.fixture
def archive(pristine: Path, tmp_path: Path) -> Archive:
    """An archive that was not run yet."""
    return Archive(Path(shutil.copytree(pristine, tmp_path / "fresh")))


@pytest.fixture
def done(finished: Path, tmp_path: Path) -> Archive:
    """The same archive after a run, at another place: results do not depend on the place."""
    return Archive(Path(shutil.copytree(finished, tmp_path / "done")))


@pytest.fixture(scope="session")
def filmed_capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of three placements by cameras 1, 2 and 5; the films of the others lie beside it. To be read only."""
    folder = tmp_path_factory.mktemp("filmed") / "capture"
    reference = standard_reference()
    reference = reference.model_copy(update={"placements_mm": reference.placements_mm[:3]})
    record_capture(folder, reference, settings=SimulationSettings(scanner_seed=3))
    document = yaml.safe_load((folder / "capture.yaml").read_text())
    document["cameras"] = [camera for camera in document["cameras"] if camera["id"] in (1, 2, 5)]
    (folder / "capture.yaml").write_text(yaml.safe_dump(document))
    return folder


@pytest.fixture
def capture(filmed_capture: Path, tmp_path: Path) -> Path:
    """A copy of `filmed_capture` that a test may change."""
    return Path(shutil.copytree(filmed_capture, tmp_path / "capture"))

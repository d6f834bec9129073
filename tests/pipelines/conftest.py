"""A small archive: two cameras film a rounded bar, one from above and one from below, with a plain red line."""

import shutil
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
import simplejpeg
from numpy.typing import NDArray

from pipelines.archive import Job, ScanEnd, job_of_workflow, plan_job, run_job
from pipelines.engine.pool import StepEnd, Threads
from schemas.calibration import Calibration, CameraCalibration, PolynomialMap, Source

FRAMES, STEP_MM = 20, 10.0
PX_PER_MM = 5.0
CENTRE_Z_MM = 40.0

WORKFLOW = """\
format: footscan.workflow/1
archive: archive
calibration: calibration.json
results: results
workers: 2
"""

SCAN = f"""\
format: footscan.scan/1
patient: P0001
scan: S1
side: right
travel: {{start_mm: 0.0, step_mm: {STEP_MM}}}
cameras:
  - {{id: 1, file: cam1.avi}}
  - {{id: 5, file: cam5.avi}}
"""


class Archive:
    """An archive with its workflow, and what can be done with it."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.scan = root / "archive/P0001/S1"
        self.results = root / "results/P0001/S1"
        self.workflow = root / "workflow.yaml"

    def job(self) -> Job:
        return job_of_workflow(self.workflow)

    def plan(self) -> tuple[int, dict[str, str]]:
        """Number of steps; reason of each that is to run, by its name within the scan."""
        planned = plan_job(self.job(), reasons=True)
        assert planned.refused == {}
        reasons = {w.name.removeprefix("P0001/S1/"): w.reason for w in planned.waiting}
        return planned.steps, reasons

    def run(self) -> tuple[list[ScanEnd], set[str]]:
        """What became of the scans; names of the steps that ran."""
        ends: list[StepEnd] = []
        scans = list(run_job(plan_job(self.job()), Threads(2), ends.append))
        return scans, {end.step.name.removeprefix("P0001/S1/") for end in ends if end.ran}

    def set_parameters(self, parameters: str) -> None:
        self.workflow.write_text(f"{WORKFLOW}parameters: {parameters}\n")


def _frame(radius_mm: float, upper: bool) -> bytes:
    """A red half circle of Gaussian profile, as a camera that looks straight along X would see it."""
    j, i = np.mgrid[0:480, 0:640].astype(np.float64)
    distance = np.abs(np.hypot(i - 320, j - 240) - radius_mm * PX_PER_MM)
    light = 200 * np.exp(-0.5 * (distance / 1.8) ** 2) * ((j <= 245) if upper else (j >= 235))
    image = np.clip(light[..., None] * [1.0, 0.12, 0.1] + 20, 0, 255).astype(np.uint8)
    return bytes(simplejpeg.encode_jpeg(image, 90, "RGB", "420"))


def _write_film(path: Path, pictures: list[bytes]) -> None:
    with av.open(path, "w", format="avi") as container:
        stream = container.add_mux_stream("mjpeg", rate=18, width=640, height=480)
        stream.time_base = Fraction(1, 18)
        for number, picture in enumerate(pictures):
            packet = av.Packet(picture)
            packet.stream, packet.time_base, packet.pts, packet.dts = stream, stream.time_base, number, number
            packet.duration, packet.is_keyframe = 1, True
            container.mux(packet)


def _calibration(scale: float = 1.0) -> Calibration:
    pixel_map = PolynomialMap(
        order=1, centre_px=(320.0, 240.0), scale_px=PX_PER_MM, alpha_y=[0.0, scale, 0.0],
        alpha_z=[CENTRE_Z_MM, 0.0, -scale],
    )  # fmt: skip
    cameras = [CameraCalibration(camera=camera, map=pixel_map, region_px=[], points=0) for camera in (1, 5)]
    return Calibration(sources=[Source(name="made up", sha256="")], software="tests", cameras=cameras)


def _radii() -> NDArray[np.float64]:
    """mm: the bar narrows towards both its ends."""
    along = np.linspace(-1, 1, FRAMES)
    return 14 + 18 * np.sqrt(1 - along**2)


@pytest.fixture(scope="session")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("pristine") / "home"
    archive = Archive(root)
    archive.scan.mkdir(parents=True)
    archive.workflow.write_text(WORKFLOW)
    (root / "calibration.json").write_text(_calibration().model_dump_json())
    (archive.scan / "scan.yaml").write_text(SCAN)
    for camera, upper in ((1, True), (5, False)):
        _write_film(archive.scan / f"cam{camera}.avi", [_frame(radius, upper) for radius in _radii()])
    return root


@pytest.fixture(scope="session")
def finished(pristine: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("finished") / "home"
    shutil.copytree(pristine, root)
    scans, _ = Archive(root).run()
    assert [(scan.scan, scan.problem) for scan in scans] == [("P0001/S1", None)]
    return root


@pytest.fixture
def archive(pristine: Path, tmp_path: Path) -> Archive:
    """Films of which nothing has been made yet."""
    return Archive(Path(shutil.copytree(pristine, tmp_path / "fresh")))


@pytest.fixture
def done(finished: Path, tmp_path: Path) -> Archive:
    """The same after a run; moved, for nothing depends on where it lies."""
    return Archive(Path(shutil.copytree(finished, tmp_path / "done")))


@pytest.fixture(scope="session")
def calibration() -> Callable[..., Calibration]:
    return _calibration

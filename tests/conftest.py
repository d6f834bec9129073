"""A small archive: two cameras film a cone from its tip, one its upper half, one its lower, a plain red line.

A folder with `workflow.yaml`, `calibration.json` and the scan `archive/P0001/S1`.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from footscan.virtual.film import write_film
from schemas.calibration import Calibration, CameraCalibration, PolynomialMap, Source

CAMERAS = {1: True, 5: False}
"""Whether each looks from above."""
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


@pytest.fixture(scope="session")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Before its first run. To be read only."""
    root = tmp_path_factory.mktemp("pristine") / "home"
    scan = root / "archive/P0001/S1"
    scan.mkdir(parents=True)
    (root / "workflow.yaml").write_text(WORKFLOW)
    (root / "calibration.json").write_text(_calibration().model_dump_json())
    (scan / "scan.yaml").write_text(SCAN)
    radii = np.linspace(36.0, 6.0, FRAMES)  # mm: it narrows towards the cameras, or they would not see its side
    for camera, upper in CAMERAS.items():
        write_film(scan / f"cam{camera}.avi", [_frame(radius, upper) for radius in radii], 640, 480, 18)
    return root


@pytest.fixture(scope="session")
def calibration() -> Callable[..., Calibration]:
    """Of the archive's two cameras, at a scale that may be another."""
    return _calibration


def _calibration(scale: float = 1.0) -> Calibration:
    pixel_map = PolynomialMap(
        order=1, centre_px=(320.0, 240.0), scale_px=PX_PER_MM, alpha_y=[0.0, scale, 0.0],
        alpha_z=[CENTRE_Z_MM, 0.0, -scale],
    )  # fmt: skip
    cameras = [CameraCalibration(camera=camera, map=pixel_map, region_px=[], points=0) for camera in CAMERAS]
    return Calibration(sources=[Source(name="made up", sha256="")], software="tests", cameras=cameras)


def _frame(radius_mm: float, upper: bool) -> bytes:
    """A red half circle of Gaussian profile, as a camera that looks straight along X would see it."""
    j, i = np.mgrid[0:480, 0:640].astype(np.float64)
    distance = np.abs(np.hypot(i - 320, j - 240) - radius_mm * PX_PER_MM)
    light = 200 * np.exp(-0.5 * (distance / 1.8) ** 2) * ((j <= 245) if upper else (j >= 235))
    image = np.clip(light[..., None] * [1.0, 0.12, 0.1] + 20, 0, 255).astype(np.uint8)
    return bytes(simplejpeg.encode_jpeg(image, 90, "RGB", "420"))

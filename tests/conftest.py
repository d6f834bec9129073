"""A small archive: two cameras film a rough foot, one from the left and above, one from the right and below.

A folder with `workflow.yaml`, `calibration.json` and the scan `archive/P0001/S1`.
"""

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import simplejpeg
from hypothesis import settings
from numpy.typing import NDArray

from footscan.virtual.filming.film import write_film
from schemas.calibration import Calibration, CameraCalibration, HomographyMap, Source

sys.path.insert(0, str(Path(__file__).parent / "helpers"))  # this folder itself would hide the packages

from shared_folders import MadeOnce, once_a_code, once_a_run

settings.register_profile("untimed", deadline=None)  # machines stand still now and then
settings.load_profile("untimed")

CAMERAS = {1: 1.0, 5: -1.0}
"""On which side of a plane along the foot each stands; the plane leans, so that one is above and one below."""
FRAMES, STEP_MM = 20, 10.0
FOCAL_PX = 1500.0
AWAY_MM = np.array([250.0, 280.0, 280.0])
"""Of a camera from the middle of what it films: ahead, aside and above, or as far aside and below."""
CENTRE_PX = (320.0, 240.0)
MIDDLE_Z_MM = 14.0
STATIONS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Along the foot, for half its breadth, and for its height above and below the middle."""
HALF_BREADTHS_MM = (24.0, 26.0, 28.0, 32.0, 32.0, 22.0)
HEIGHTS_MM = (52.0, 52.0, 34.0, 20.0, 12.0, 8.0)
DEPTHS_MM = (9.0, 10.5, 11.0, 11.5, 11.0, 9.0)

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
def made_once(tmp_path_factory: pytest.TempPathFactory) -> MadeOnce:
    """Folders that the workers of this test run share."""
    return once_a_run(tmp_path_factory)


@pytest.fixture(scope="session")
def films(request: pytest.FixtureRequest) -> MadeOnce:
    """Folders of films that test runs of the same simulator share. To be read only."""
    return once_a_code(request.config.cache.mkdir("films"))


@pytest.fixture(scope="session")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Before its first run. To be read only."""
    root = tmp_path_factory.mktemp("pristine") / "home"
    root.mkdir()
    (root / "workflow.yaml").write_text(WORKFLOW)
    (root / "calibration.json").write_text(_calibration().model_dump_json())
    _write_scan(root / "archive/P0001/S1", SCAN, 1.0)
    return root


@pytest.fixture(scope="session")
def write_scan() -> Callable[[Path, str, float], None]:
    """Write a scan folder: where, its scan.yaml, and how much broader its foot is."""
    return _write_scan


def _write_scan(folder: Path, document: str, broader: float) -> None:
    folder.mkdir(parents=True)
    (folder / "scan.yaml").write_text(document)
    along = np.linspace(0.0, 1.0, FRAMES)
    half_breadths = broader * np.array(HALF_BREADTHS_MM)
    sections = np.column_stack([np.interp(along, STATIONS, of) for of in (half_breadths, HEIGHTS_MM, DEPTHS_MM)])
    for camera in CAMERAS:
        film = [_frame(camera, *section) for section in sections.tolist()]
        write_film(folder / f"cam{camera}.avi", film, 640, 480, 18)


@pytest.fixture(scope="session")
def calibration() -> Callable[..., Calibration]:
    """Of the archive's two cameras, at a scale that may be another."""
    return _calibration


def _calibration(scale: float = 1.0) -> Calibration:
    cameras = []
    for camera in CAMERAS:
        matrix = np.diag([scale, scale, 1.0]) @ _to_plane(camera)
        pixel_map = HomographyMap(
            centre_px=CENTRE_PX, scale_px=1.0, matrix=(matrix / matrix[2, 2]).ravel()[:8].tolist()
        )
        cameras.append(CameraCalibration(camera=camera, map=pixel_map, region_px=[], points=0))
    return Calibration(sources=[Source(name="made up", sha256="")], software="tests", cameras=cameras)


def _to_plane(camera: int) -> NDArray[np.float64]:
    """(3, 3) homography from pixels about `CENTRE_PX` to Y and Z in mm in the laser's plane, X = 0."""
    away = AWAY_MM * [1.0, CAMERAS[camera], CAMERAS[camera]]
    forward = -away / np.linalg.norm(away)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(forward, right), forward])  # columns, rows and depth of the image
    from_plane = np.diag([FOCAL_PX, FOCAL_PX, 1.0]) @ np.column_stack([axes[:, 1], axes[:, 2], -axes @ away])
    about_middle = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, MIDDLE_Z_MM], [0.0, 0.0, 1.0]])
    return about_middle @ np.linalg.inv(from_plane)


@cache  # many tests have the same few feet
def _frame(camera: int, half_breadth: float, height: float, depth: float) -> bytes:
    """A red line of Gaussian profile around a section, as far as the camera sees it."""
    j, i = np.mgrid[0:480, 0:640].astype(np.float64)
    y, z, w = np.tensordot(_to_plane(camera), [i - CENTRE_PX[0], j - CENTRE_PX[1], np.ones_like(i)], axes=1)
    y, z = y / w, z / w - MIDDLE_Z_MM
    up = np.where(z > 0, height, depth)
    ellipse = np.hypot(y / half_breadth, z / up)
    away = np.array([y / half_breadth**2, z / up**2]) / np.maximum(ellipse, 1e-9)  # how it grows, per mm
    distance = np.abs(ellipse - 1.0) / np.maximum(np.hypot(*np.gradient(ellipse)), 1e-9)  # px
    is_seen = (away[0] + away[1]) * CAMERAS[camera] > 0
    light = 200 * np.exp(-0.5 * (distance / 1.8) ** 2) * is_seen
    image = np.clip(light[..., None] * [1.0, 0.12, 0.1] + 20, 0, 255).astype(np.uint8)
    return bytes(simplejpeg.encode_jpeg(image, 90, "RGB", "420"))

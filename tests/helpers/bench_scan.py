"""The films of the recorded scan that all end-to-end tests share."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from footscan.mesh.formats.files import read_mesh
from footscan.virtual.filming.renderers import Shot, shoot
from footscan.virtual.optics.scene import SKIN, Mesh
from schemas.parameters.simulation import SimulationSettings

FRAMES, STEP_MM = 48, 6.0
"""Coarse, but a foot can be measured from them; what these tests look at does not depend on the number of frames."""
FILMING_SECONDS = 1200
"""Longer than a scan is filmed on a machine that has other work to do."""
FOOTSCAN = Path(sys.executable).with_name("footscan")


def run_footscan(*arguments: object, timeout: float = 300, **options: Any) -> subprocess.CompletedProcess[str]:
    """`footscan ARGUMENTS` as a process of its own."""
    line = [str(part) for part in (FOOTSCAN, *arguments)]
    return subprocess.run(line, capture_output=True, text=True, timeout=timeout, check=False, **options)


def film_bench(bench: Path) -> None:
    """Film a capture, and the right foot as a scan."""
    scan = bench / "archive" / "P0001" / "small"
    for arguments in (
        ("capture", "--out", bench / "capture"),
        ("scan", "--foot", "right", "--out", scan, "--frames", FRAMES, "--step-mm", STEP_MM),
    ):
        done = run_footscan("simulate", *arguments, timeout=FILMING_SECONDS)
        assert done.returncode == 0, done.stderr


def laser_off_of(truth: Path) -> Callable[[Path], None]:
    """Films the foot `truth` once more with camera 1 and with the laser off; a JPEG file per frame."""

    def film(folder: Path) -> None:
        settings = SimulationSettings(frames=FRAMES, step_mm=STEP_MM, laser_exposure=0.0)
        shots = [Shot(FRAMES + frame, STEP_MM * frame, 0) for frame in range(FRAMES)]
        folder.mkdir()
        for _, part in shoot([Mesh(*read_mesh(truth))], SKIN, [1], shots, settings, workers=1):
            for picture in part:
                (folder / f"{len(list(folder.iterdir())):02d}.jpg").write_bytes(picture)

    return film

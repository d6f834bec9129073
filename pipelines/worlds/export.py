"""Writes a world into a folder, to look at it or to reconstruct it by hand."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from footscan.calibration.chart.chart import read_chart
from footscan.calibration.chart.from_chart import calibrate_chart
from footscan.virtual.filming.record import write_yaml
from footscan.virtual.optics.scene import Mesh
from footscan.virtual.worlds.film.record import CALIBRATION, CHART, record_world, write_world
from footscan.virtual.worlds.machine import machine_of
from footscan.virtual.worlds.stripes import world_stripes
from footscan.virtual.worlds.subject import make_subject
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.files.digest import sha256
from pipelines.version import SOFTWARE
from schemas.calibration import Source
from schemas.parameters.calibration import CalibrationParameters
from schemas.world import World

COLUMNS = ("frame", "i", "j", "width", "peak", "score")
FORMAT = ("%d", "%.3f", "%.3f", "%.2f", "%.1f", "%.3f")


def write_films(
    world: World, folder: Path, progress: Callable[[int, int], None] | None = None, body: Mesh | None = None
) -> None:
    """Film a world into a scan folder that is ready to run: its chart is calibrated.

    body : closed mesh, mm, that is filmed in place of the world's subject, to calibrate where the laser planes lie.

    Raises
    ------
    RefusedInput
        As in `calibrate_chart`; the films are there.
    """
    record_world(world, folder, body=body, progress=progress)
    chart = folder / CHART
    source = Source(name=CHART, sha256=sha256(chart.read_bytes()))
    calibration, _ = calibrate_chart(
        read_chart(chart), parameters=CalibrationParameters(), source=source, software=SOFTWARE
    )
    write_atomically(folder / CALIBRATION, (calibration.model_dump_json(indent=2) + "\n").encode())


def write_points(world: World, folder: Path) -> None:
    """Write the files of `write_world`, `travels.yaml` and the stripe points of each camera, `camN.csv`.

    The folder is created if missing.
    """
    machine, subject = machine_of(world), make_subject(world.subject)
    folder.mkdir(parents=True, exist_ok=True)
    write_world(machine, subject, folder)
    steps = {camera: machine.step_mm(machine.head_of[camera]) for camera in machine.cameras}
    travels = {f"cam{camera}": {"start_mm": 0.0, "step_mm": step} for camera, step in steps.items()}
    write_yaml(folder / "travels.yaml", travels)
    for camera, points in world_stripes(machine, subject).items():
        rows = np.column_stack([points[name] for name in COLUMNS])
        np.savetxt(folder / f"cam{camera}.csv", rows, FORMAT, delimiter=",", header=",".join(COLUMNS), comments="")

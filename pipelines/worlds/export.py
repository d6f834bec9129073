"""Writes a world without pictures into a folder, to look at it or to reconstruct it by hand."""

from pathlib import Path

import numpy as np

from footscan.virtual.filming.record import write_yaml
from footscan.virtual.worlds.film.record import write_world
from footscan.virtual.worlds.machine import HEAD_OF_CAMERA, machine_of
from footscan.virtual.worlds.stripes import world_stripes
from footscan.virtual.worlds.subject import make_subject
from schemas.world import World

COLUMNS = ("frame", "i", "j", "width", "peak", "score")
FORMAT = ("%d", "%.3f", "%.3f", "%.2f", "%.1f", "%.3f")


def write_points(world: World, folder: Path) -> None:
    """Write the files of `write_world`, `travels.yaml` and the stripe points of each camera, `camN.csv`.

    The folder is created if missing.
    """
    machine, subject = machine_of(world), make_subject(world.subject)
    folder.mkdir(parents=True, exist_ok=True)
    write_world(machine, subject, folder)
    steps = {camera: machine.step_mm(HEAD_OF_CAMERA[camera]) for camera in machine.cameras}
    travels = {f"cam{camera}": {"start_mm": 0.0, "step_mm": step} for camera, step in steps.items()}
    write_yaml(folder / "travels.yaml", travels)
    for camera, points in world_stripes(machine, subject).items():
        rows = np.column_stack([points[name] for name in COLUMNS])
        np.savetxt(folder / f"cam{camera}.csv", rows, FORMAT, delimiter=",", header=",".join(COLUMNS), comments="")

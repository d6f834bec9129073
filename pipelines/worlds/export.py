"""Writes a world into a folder, to look at it or to reconstruct it by hand."""

from pathlib import Path

import numpy as np

from footscan.virtual.filming.record import write_stl, write_yaml
from footscan.virtual.worlds.chart import world_chart
from footscan.virtual.worlds.draw import draw_world
from footscan.virtual.worlds.machine import HEAD_OF_CAMERA, machine_of
from footscan.virtual.worlds.stripes import world_stripes
from footscan.virtual.worlds.subject import make_subject

COLUMNS = ("frame", "i", "j", "width", "peak", "score")
FORMAT = ("%d", "%.3f", "%.3f", "%.2f", "%.1f", "%.3f")


def write_world(seed: int, folder: Path) -> list[Path]:
    """Write `world.json`, `measures.yaml`, `truth.stl`, `chart.csv`, `travels.yaml` and a `camN.csv` for each camera.

    The folder is created if missing. Returns the files of the cameras.
    """
    world = draw_world(seed)
    machine, subject = machine_of(world), make_subject(world.subject)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "world.json").write_text(world.model_dump_json(indent=2) + "\n", encoding="utf-8")
    write_yaml(folder / "measures.yaml", subject.measures)
    write_stl(folder / "truth.stl", machine.plate.apply(subject.mesh.vertices), subject.mesh.faces)
    (folder / "chart.csv").write_text(world_chart(machine), encoding="utf-8")
    steps = {camera: machine.step_mm(HEAD_OF_CAMERA[camera]) for camera in machine.cameras}
    travels = {f"cam{camera}": {"start_mm": 0.0, "step_mm": step} for camera, step in steps.items()}
    write_yaml(folder / "travels.yaml", travels)
    files = []
    for camera, points in world_stripes(machine, subject).items():
        files.append(folder / f"cam{camera}.csv")
        rows = np.column_stack([points[name] for name in COLUMNS])
        np.savetxt(files[-1], rows, FORMAT, delimiter=",", header=",".join(COLUMNS), comments="")
    return files

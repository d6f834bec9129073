"""Records the scan of a world: films, scan.yaml, the true surface, the chart of its scanner, its description."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import yaml

from footscan.virtual.filming.film import write_film
from footscan.virtual.filming.processes import shoot_in_order
from footscan.virtual.filming.record import film_name, write_stl, write_yaml
from footscan.virtual.optics.scene import SKIN, Mesh, Scene
from footscan.virtual.worlds.chart import world_chart
from footscan.virtual.worlds.film.camera_film import CameraFilm
from footscan.virtual.worlds.machine import Machine, machine_of, when_calibrated
from footscan.virtual.worlds.subject import Subject, make_body, make_subject
from schemas.world import World

FRAMES_A_TASK = 16
"""Frames that a process renders at a time; no byte depends on it. Chosen by hand."""
PATIENT = "worlds"
"""Pseudonym in scan.yaml."""
CHART = "chart.csv"
CALIBRATION = "calibration.json"
"""Name in scan.yaml of the calibration that whoever reconstructs the world makes of its chart."""


def record_world(
    world: World,
    folder: Path,
    *,
    body: Mesh | None = None,
    progress: Callable[[int, int], None] | None = None,
    workers: int = 2,
) -> None:
    """Film a world into `folder`, which is created; scan.yaml is written last.

    body : closed mesh, mm, Z = 0 at its foot, that is filmed in place of the world's subject, as its scanner was when
    it was calibrated. progress : called with the number of frames done and in total. workers : number of processes; 1
    is this one alone.
    """
    studio = _Studio(world, body)
    machine, subject = studio.machine, studio.subject
    folder.mkdir(parents=True, exist_ok=True)
    write_world(replace(machine, world=world), subject, folder)
    counts = {camera: machine.frames(machine.head_of[camera]) for camera in machine.cameras}
    done, total = 0, sum(counts.values())
    pictures: list[bytes] = []
    rows, columns = machine.size
    tasks = [
        (camera, range(first, min(first + FRAMES_A_TASK, count)))
        for camera, count in counts.items()
        for first in range(0, count, FRAMES_A_TASK)
    ]
    for camera, part in shoot_in_order(_Studio, (world, body), tasks, workers):
        pictures += part
        done += len(part)
        if len(pictures) == counts[camera]:
            rate = round(world.cameras.frames_per_second)
            write_film(folder / film_name(camera), pictures, columns, rows, rate)
            pictures = []
        if progress is not None:
            progress(done, total)
    cameras = [
        {
            "id": camera,
            "file": film_name(camera),
            "travel": {"start_mm": 0.0, "step_mm": machine.step_mm(head)},
            "pass_number": machine.pass_number(head),
        }
        for camera, head in machine.head_of.items()
    ]
    scan = {
        "format": "footscan.scan/1", "patient": PATIENT, "scan": f"{world.seed}" + ("-body" if body else ""),
        "side": world.subject.side, "truth": "truth.stl", "calibration": CALIBRATION, "cameras": cameras,
    }  # fmt: skip
    write_yaml(folder / "scan.yaml", scan)


def write_world(machine: Machine, subject: Subject, folder: Path) -> None:
    """Write `world.json`, `measures.yaml` (true measures), `truth.stl` and `chart.csv` into a folder."""
    (folder / "world.json").write_text(machine.world.model_dump_json(indent=2) + "\n", encoding="utf-8")
    (folder / "measures.yaml").write_text(yaml.safe_dump(subject.measures, sort_keys=False), encoding="utf-8")
    write_stl(folder / "truth.stl", machine.plate.apply(subject.mesh.vertices), subject.mesh.faces)
    (folder / CHART).write_text(world_chart(machine), encoding="utf-8")


class _Studio:
    """The world that a process films; its camera is kept until another one is requested."""

    def __init__(self, world: World, body: Mesh | None) -> None:
        self.machine = machine_of(world)
        if body is None:
            self.subject = make_subject(world.subject)
        else:
            self.machine, self.subject = when_calibrated(self.machine), make_body(body, world.seed)
        self._scene: Scene | None = None
        self._film: tuple[int, CameraFilm] | None = None

    def shoot(self, camera: int, frames: range) -> list[bytes]:
        """Return the JPEG pictures of frames."""
        if self._scene is None:
            self._scene = Scene(self.subject.mesh, SKIN)
        if self._film is None or self._film[0] != camera:
            self._film = camera, CameraFilm(self.machine, self.subject, camera, self._scene)
        return [self._film[1].jpeg(frame) for frame in frames]

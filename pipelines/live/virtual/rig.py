"""A virtual scanner that is ready to scan: a running world, and a rig like that of a real scanner.

Rig and calibration are kept in a folder, so that the second start is quick. Latencies are measured as for a real
scanner: the rig never gets them from the world.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from footscan.calibration.travel.body import standard_body
from footscan.mesh.formats.files import mesh_bytes
from footscan.mesh.mesh import Mesh
from footscan.virtual.stage.reference import standard_reference
from pipelines.archive.job import CACHE
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.pool import Threads
from pipelines.engine.workspace import Workspace, digests_by_kind
from pipelines.live.latencies import measure_latencies, rig_with
from pipelines.live.light import light_by_hand
from pipelines.live.rig_file import read_rig, write_rig
from pipelines.live.scanner import LiveScanner
from pipelines.live.virtual.delivery import Delivery, delivery_of
from pipelines.live.virtual.process import WorldProcess
from pipelines.live.virtual.world import CAMERAS, EXPOSURE_MS, World, block_range_mm
from pipelines.simulate import filmed_calibration_steps
from schemas.base.errors import Fault
from schemas.parameters.simulation import SimulationSettings
from schemas.rig import Rig, RigCamera

TRIES = 3
"""Attempts to measure the latencies, which fail only if the host was too busy; chosen by hand."""
OnProgress = Callable[[str, int, int], None]
"""Called with the name of the preparation, the amount done and the total."""


@dataclass(frozen=True)
class VirtualRig:
    """A virtual scanner that is ready to scan."""

    rig: Rig
    file: Path
    world: WorldProcess


@contextmanager
def virtual_rig(
    folder: Path, world: World, on_progress: OnProgress, *, calibrated: bool = True, is_delivered: bool = True
) -> Iterator[VirtualRig]:
    """Run the virtual scanner of `folder` in a world of its own, and prepare what is missing in the folder.

    Parameters
    ----------
    calibrated : True to make a missing calibration, and to measure missing latencies
    is_delivered : True to take those with which the scanner is delivered, if there are any
    """
    file = folder / "rig.yaml"
    delivery = delivery_of(world.scanner_seed) if is_delivered else None
    rig = _stored_rig(file, world, delivery)
    world = _with_objects(world, folder)
    lacks_latency = calibrated and any(camera.latency is None for camera in rig.cameras)
    calibration = folder / f"calibration-{world.scanner_seed}.json"
    if calibrated and not _has_calibration(rig) and not calibration.exists():
        if delivery is not None:
            write_atomically(calibration, (delivery.calibration.model_dump_json() + "\n").encode())
        else:
            on_progress("calibration", 0, 1)
            _calibrate(folder, calibration, world.scanner_seed)
    with WorldProcess(world.model_copy(update={"subject": "block"}) if lacks_latency else world) as process:
        rig = _plugged_in(rig, process, calibration)
        write_rig(file, rig)
        if lacks_latency:
            rig = _with_latencies(rig, world, on_progress)
            write_rig(file, rig)
            process.put(world.subject)
        yield VirtualRig(rig, file, process)


def _stored_rig(file: Path, world: World, delivery: Delivery | None) -> Rig:
    scanner = f"virtual-{world.scanner_seed}"
    if file.exists() and (rig := read_rig(file)).scanner == scanner:
        return rig
    latencies = {} if delivery is None else delivery.latencies
    cameras = [RigCamera(id=camera, device=f"camera {camera}", latency=latencies.get(camera)) for camera in CAMERAS]
    return Rig(format="footscan.rig/1", scanner=scanner, port="unknown", cameras=cameras)


def _with_objects(world: World, folder: Path) -> World:
    """The world with the reference object and the body of a folder, which are written if they are missing."""
    reference, body = folder / "reference.yaml", folder / "body.stl"
    if not reference.exists():
        document = standard_reference().model_dump(mode="json")
        write_atomically(reference, yaml.safe_dump(document, sort_keys=False, default_flow_style=None).encode())
    if not body.exists():
        shape = standard_body()
        write_atomically(body, mesh_bytes(Mesh(shape.vertices, shape.faces.astype(np.int32)), ".stl"))
    return world.model_copy(update={"reference": str(reference), "body": str(body)})


def _plugged_in(rig: Rig, process: WorldProcess, first: Path) -> Rig:
    """The rig with the present addresses of the devices, and with its calibration or, if it has none, the first one."""
    cameras = [
        camera.model_copy(
            update={
                "device": process.cameras[camera.id],
                "control_url": process.cameras[camera.id].replace("/stream", "/control"),
            }
        )
        for camera in rig.cameras
    ]
    calibration = rig.calibration
    if not _has_calibration(rig):
        calibration = str(first.resolve()) if first.exists() else None
    return rig.model_copy(update={"port": process.port, "cameras": cameras, "calibration": calibration})


def _has_calibration(rig: Rig) -> bool:
    return rig.calibration is not None and Path(rig.calibration).exists()


def _with_latencies(rig: Rig, world: World, on_progress: OnProgress) -> Rig:
    light = light_by_hand(rig, 1.0, EXPOSURE_MS)
    with LiveScanner(rig) as scanner:
        scanner.connect()
        for _ in range(TRIES):
            measured = measure_latencies(
                scanner, *block_range_mm(world), light, lambda done, total: on_progress("latencies", done, total)
            )
            if not measured.problems:
                return rig_with(rig, measured.latencies, light)
    raise Fault("; ".join(measured.problems.values()))


def _calibrate(folder: Path, file: Path, scanner_seed: int) -> None:
    """Calibrate the scanner from a capture of the reference object."""
    steps = filmed_calibration_steps(
        f"virtual-{scanner_seed}", folder / f"capture-{scanner_seed}", SimulationSettings(scanner_seed=scanner_seed)
    )
    with Workspace(folder / CACHE) as workspace, workspace.lease():
        outcomes = workspace.run(steps, Threads(1), lambda _: None)
        digests = digests_by_kind(steps, outcomes)
        if problem := workspace.deliver({file.name: digests["calibrate"]}, folder):
            raise Fault(problem)

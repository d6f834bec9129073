"""The laser planes of a scanner from the film of a body, as a job."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Protocol

import numpy as np

from footscan.calibration.travel.body import Body
from footscan.mesh.formats.files import read_mesh
from footscan.recordings.scans import RecordedScan
from pipelines.arrays import pack
from pipelines.engine.actions.step import Failure, Input, Step, Value
from pipelines.engine.files.file_digests import FileDigests
from pipelines.engine.pool import Threads
from pipelines.engine.workspace import Workspace
from pipelines.scan import STEPS, CalibrationFile, ScanCalibration, scan_steps
from schemas.base.errors import DamagedError, Fault, RefusedInput
from schemas.base.model import canonical_json
from schemas.calibration import Calibration
from schemas.parameters.scan import ScanParameters


class WholeCalibration(ScanCalibration, Protocol):
    """A calibration of which also the whole can be had."""

    @property
    def whole(self) -> Input:
        """All of it."""


OF_CAMERA = ("ingest", "background", "extract")
"""Kinds of a scan's steps that the film of a body takes."""


def calibrate_travel(
    film: RecordedScan,
    calibration: CalibrationFile,
    head_of_camera: Mapping[int, int],
    body: Body,
    workers: int,
    cache: Path | None = None,
) -> Calibration:
    """Find the laser planes with `workers` threads; results in `cache` are not computed again.

    Raises
    ------
    RefusedInput
        A film is missing or of another kind, or the film does not show the body.
    Fault
        A step could not be run to its end.
    """
    with TemporaryDirectory(prefix="footscan-") as temporary, Workspace(cache or Path(temporary)) as workspace:
        steps = travel_steps(film, calibration, head_of_camera, body, workspace.digests)
        with workspace.lease():
            outcomes = workspace.run(steps, Threads(workers), lambda _: None)
            end = outcomes[steps[-1].name]
            if isinstance(end, Failure):
                if end.kind in {"refused", "finding"}:
                    raise RefusedInput(film.file, end.problem)
                raise Fault(end.problem)
            result = workspace.store.get(end.digest)
    if result is None:
        raise DamagedError(f"{steps[-1].name}: the result is damaged, expected what was stored; run again")
    return Calibration.model_validate_json(result)


def travel_steps(
    film: RecordedScan,
    calibration: WholeCalibration,
    head_of_camera: Mapping[int, int],
    body: Body,
    digests: FileDigests,
) -> list[Step]:
    """Build the steps from the films of a body to the calibration, the result of the last step, of kind `planes`."""
    all_steps = scan_steps(film, calibration, ScanParameters(), digests)
    steps = [step for step in all_steps if step.kind in OF_CAMERA]
    inputs: dict[str, Input] = {
        "calibration": calibration.whole,
        "body": body_value(body),
        "heads": heads_value(head_of_camera),
    }
    for step in all_steps:
        if step.kind == "map":
            inputs |= {f"{name}-{step.camera}": of for name, of in step.inputs.items() if name != "calibration"}
    return [*steps, Step(film.name, "planes", f"{STEPS}.laser_planes", None, inputs)]


def read_body(file: Path) -> Body:
    """Read the mesh of a body, mm."""
    vertices, faces = read_mesh(file)
    return Body(vertices, faces.astype(np.int64))


def body_value(body: Body) -> Value:
    """A body as an input of a step."""
    return Value(pack(vertices=body.vertices, faces=body.faces))


def heads_value(head_of_camera: Mapping[int, int]) -> Value:
    """The heads of the cameras as an input of a step."""
    return Value(canonical_json({str(camera): head for camera, head in sorted(head_of_camera.items())}).encode())

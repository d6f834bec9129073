"""One capture as a job: a new calibration, or the drift of the scanner since its last calibration."""

import importlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.as_arrays import points_of, seen_by
from footscan.calibration.capture.found_corners import FoundCorner
from footscan.calibration.capture.from_capture import CalibratedView, Recognised
from footscan.calibration.capture.refused_capture import RefusedCapture
from footscan.calibration.checks.drift import Drift, drift_of
from footscan.calibration.models.selection import ModelTrial
from footscan.frames.film import open_film
from footscan.frames.reader import pixel_frames
from footscan.report.calibration.capture_figure import capture_figure
from pipelines.arrays import unpack
from pipelines.calibrate import CaptureInputs, calibration_steps, camera_steps, fit_steps, recorded_inputs
from pipelines.engine.actions.step import Failure, Outcome, Output, Step
from pipelines.engine.pool import Threads
from pipelines.engine.progress import OnProgress, unheard
from pipelines.engine.run import content_of
from pipelines.engine.store.store import Store
from pipelines.engine.workspace import Workspace
from pipelines.recordings.captures import RecordedCapture
from schemas.base.errors import DamagedError, Fault
from schemas.calibration import Calibration, CameraCalibration
from schemas.parameters.calibration import CaptureCalibrationParameters

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CaptureCalibration:
    """A calibration from a capture, and the evidence behind it."""

    calibration: Calibration
    trials: list[ModelTrial]
    corners: list[FoundCorner]
    x_mm: float
    """X of all corners: the position of the laser plane."""
    departures_mm: Floats
    """(K, 2) offsets in Y and Z, mm, of the object from its K nominal placements, as all cameras see it; zeros if a
    correction does not improve the fit."""


def calibrate_capture(
    capture: RecordedCapture,
    parameters: CaptureCalibrationParameters,
    workers: int,
    cache: Path | None = None,
    *,
    keep_going: bool = False,
    on_progress: OnProgress = unheard,
) -> CaptureCalibration:
    """Calibrate all cameras of a capture with `workers` threads; results in `cache` are not computed again.

    With `keep_going`, cameras that see the object from another side than they stand on are calibrated as well.
    `on_progress` is called with the steps that have ended and their number.

    Raises
    ------
    RefusedInput
        Two cameras have the same film. A `RefusedCapture`: the object is not recognised, or was wrongly placed.
    Fault
        A step could not be run to its end.
    """
    with _job(capture, workers, cache, on_progress) as job:
        steps = calibration_steps(job.name, job.inputs, parameters, keep_going=keep_going)
        results = job.run(steps)
        fits = [json.loads(_fit(job, results, camera)["document"].tobytes()) for camera in sorted(job.cameras)]
        poses = unpack(results[f"{job.name}/place"])["poses"]
        return CaptureCalibration(
            Calibration.model_validate_json(results[f"{job.name}/calibrate"]),
            [ModelTrial(**trial) for fit in fits for trial in fit["trials"]],
            [FoundCorner(**corner) for fit in fits for corner in fit["corners"]],
            capture.document.x_mm,
            poses[:, :2] - np.array(capture.reference.placements_mm, np.float64),
        )


def check_calibration(
    calibration: Calibration,
    capture: RecordedCapture,
    parameters: CaptureCalibrationParameters,
    tolerance_mm: float,
    workers: int,
    cache: Path | None = None,
    on_progress: OnProgress = unheard,
) -> list[Drift]:
    """Measure the drift of each camera of a scanner since its calibration, with a present capture.

    A camera that does not recognise the object, or is only in the capture or only in the calibration, is reported too.

    Raises
    ------
    RefusedInput
        A `RefusedCapture`: the object was wrongly placed, or no camera recognises it.
    Fault
        A step could not be run to its end.
    """
    with _job(capture, workers, cache, on_progress) as job:
        steps = camera_steps(job.name, job.inputs, parameters)
        results = job.run([*steps, *fit_steps(job.name, job.inputs, parameters, "place")])
        drifts = []
        for camera in sorted(calibration.cameras, key=lambda calibrated: calibrated.view):
            if camera.view in job.cameras:
                drifts.append(_drift(job, results, camera, tolerance_mm))
            else:
                drifts.append(Drift(camera.view, "not in the capture"))
        calibrated_ids = {camera.view for camera in calibration.cameras}
        uncalibrated_ids = sorted(set(job.cameras) - calibrated_ids)
        return drifts + [Drift(number, "not in the calibration") for number in uncalibrated_ids]


def picture_of(capture: RecordedCapture, refused: RefusedCapture) -> bytes:
    """Draw the evidence for which a capture was refused, as PNG."""
    films = {camera.view: capture.film(camera) for camera in capture.document.cameras}
    shown = [
        (evidence, next(pixel_frames(open_film(films[evidence.camera]), [evidence.frame]), None))
        for evidence in refused.evidence
    ]
    return capture_figure(str(refused), shown)


@dataclass(frozen=True)
class _Job:
    """A capture whose steps can be run."""

    name: str
    inputs: CaptureInputs
    workspace: Workspace
    workers: int
    on_progress: OnProgress

    @property
    def cameras(self) -> list[int]:
        """Numbers of the views."""
        return list(self.inputs.paths)

    def run(self, steps: Sequence[Step]) -> dict[str, bytes]:
        """Run steps and return their results by name; raises the error of a failed step."""
        total, ended = len(self.workspace.plan(steps).to_run), count(1)
        with self.workspace.lease():
            outcomes = self.workspace.run(steps, Threads(self.workers), lambda _: self.on_progress(next(ended), total))
            for step in steps:
                if isinstance(failure := outcomes[step.name], Failure):
                    _raise(failure, {step.name: step for step in steps}, outcomes, self.workspace.store)
            return {name: self._result(name, outcome) for name, outcome in outcomes.items()}

    def _result(self, name: str, outcome: Outcome) -> bytes:
        assert not isinstance(outcome, Failure), "raised before"
        result = self.workspace.store.get(outcome.digest)
        if result is None:
            raise DamagedError(f"{name}: the result is damaged, expected what was stored; run again")
        return result


@contextmanager
def _job(capture: RecordedCapture, workers: int, cache: Path | None, on_progress: OnProgress) -> Iterator[_Job]:
    """The job of a capture; without a `cache` the store is temporary."""
    with TemporaryDirectory(prefix="footscan-") as temporary, Workspace(cache or Path(temporary)) as workspace:
        inputs = recorded_inputs(capture, workspace.digests)
        yield _Job(f"capture/{capture.folder.name}", inputs, workspace, workers, on_progress)


def _raise(failure: Failure, steps: Mapping[str, Step], outcomes: Mapping[str, Outcome], store: Store) -> None:
    """Raise the error of a failed step. A refused step runs again, since the store does not keep the evidence."""
    if failure.kind == "refused":
        step = steps[failure.cause]
        contents = {}
        for name, source in step.inputs.items():
            outcome = outcomes[source.step] if isinstance(source, Output) else None
            assert not isinstance(outcome, Failure), "a cause has all its inputs"
            digest = "" if outcome is None else outcome.digest
            contents[name] = content_of(step, source, digest, store)
        importlib.import_module(step.module).run(contents, step.parameters, step.places)
    raise Fault(failure.problem)


def _fit(job: _Job, results: Mapping[str, bytes], camera: int) -> Mapping[str, NDArray[Any]]:
    return unpack(results[f"{job.name}/fit-{camera}"])


def _drift(job: _Job, results: Mapping[str, bytes], calibrated: CameraCalibration, tolerance_mm: float) -> Drift:
    camera = calibrated.view
    stripe, recognised_edges = (unpack(results[f"{job.name}/{kind}-{camera}"]) for kind in ("stripe", "recognise"))
    recognised = seen_by(camera, stripe, recognised_edges)[1]
    if not isinstance(recognised, Recognised):
        return Drift(camera, "not recognised", remark=recognised)
    fit = _fit(job, results, camera)
    today = CameraCalibration.model_validate(json.loads(fit["document"].tobytes())["calibration"])
    drift = drift_of(calibrated, CalibratedView(today, [], points_of(fit), []), tolerance_mm)
    return replace(drift, remark=recognised.contradiction or drift.remark)

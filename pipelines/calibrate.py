"""From a capture: a calibration, or how far the scanner has drifted since its last one."""

from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import dask
import numpy as np
from numpy.typing import NDArray

from footscan.calibration.capture.found_corners import FoundCorner
from footscan.calibration.capture.from_capture import (
    CalibratedView,
    CameraView,
    Recognised,
    assemble,
    calibrate_view,
    object_poses,
    recognise_view,
)
from footscan.calibration.capture.reference import Edges, doubts_about, edges_of
from footscan.calibration.capture.refused_capture import (
    RefusedCapture,
    check_placements,
    refuse_contradictions,
    refuse_unrecognised,
)
from footscan.calibration.checks.drift import Drift, drift_of
from footscan.calibration.models.selection import ModelTrial
from footscan.frames.film import film_files, open_film, pixel_frames
from footscan.report.calibration.capture_figure import capture_figure
from footscan.stripe.extract import extract_stripe
from pipelines.engine.files.digest import sha256
from pipelines.recordings.captures import RecordedCapture
from pipelines.version import SOFTWARE
from schemas.base.errors import RefusedInput
from schemas.calibration import Calibration, Source
from schemas.mounting import CaptureCamera, mounting_of
from schemas.parameters.calibration import CaptureCalibrationParameters

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CaptureCalibration:
    """A calibration from a capture, and how it came about."""

    calibration: Calibration
    trials: list[ModelTrial]
    corners: list[FoundCorner]
    x_mm: float
    """Of all corners: where the laser's plane stood."""
    departures_mm: Floats
    """(K, 2) how far, in Y and Z, the object stood from where it was said, as the cameras agree; zeros where that does
    not help."""


def calibrate_capture(
    capture: RecordedCapture, parameters: CaptureCalibrationParameters, workers: int, *, keep_going: bool = False
) -> CaptureCalibration:
    """The calibration of all cameras of a capture, with so many threads.

    With `keep_going` cameras that see the object from another side than they stand on are calibrated all the same.

    Raises
    ------
    RefusedInput
        Two cameras have one film; or the object is not recognised or stood elsewhere than said, as `RefusedCapture`.
    """
    sources = _sources(capture)
    with dask.config.set(scheduler="threads", num_workers=workers):
        seen = _see(capture, parameters)
        seen.check(parameters.placement_tolerance_mm)
        refuse_unrecognised(seen.views, seen.unrecognised, seen.source)
        if not keep_going:
            refuse_contradictions(seen.recognised, seen.source)
        poses, calibrated = seen.calibrate(parameters)
    return CaptureCalibration(
        assemble(calibrated, sources, SOFTWARE, _doubts(capture, seen)),
        [trial for view in calibrated for trial in view.trials],
        [corner for view in calibrated for corner in view.corners],
        capture.document.x_mm,
        poses[:, :2] - seen.placements,
    )


def check_calibration(
    calibration: Calibration,
    capture: RecordedCapture,
    parameters: CaptureCalibrationParameters,
    tolerance_mm: float,
    workers: int,
) -> list[Drift]:
    """How far each camera of a scanner has drifted since its calibration, by a capture of today.

    A camera that does not recognise the object, or is in the capture or the calibration alone, is part of the result.

    Raises
    ------
    RefusedInput
        The object stood elsewhere than said or is recognised by no camera, as `RefusedCapture`.
    """
    filmed = [camera.id for camera in capture.document.cameras]
    with dask.config.set(scheduler="threads", num_workers=workers):
        seen = _see(capture, parameters)
        seen.check(parameters.placement_tolerance_mm)
        if not seen.recognised:
            refuse_unrecognised(seen.views, seen.unrecognised, seen.source)
        _, calibrated = seen.calibrate(parameters)
    today = {view.calibration.camera: view for view in calibrated}
    drifts = []
    for known in sorted(calibration.cameras, key=lambda camera: camera.camera):
        if known.camera in today:
            drift = drift_of(known, today[known.camera], tolerance_mm)
            drifts.append(replace(drift, remark=seen.recognised[known.camera].contradiction or drift.remark))
        elif known.camera in filmed:
            drifts.append(Drift(known.camera, "not recognised", remark=seen.unrecognised[known.camera]))
        else:
            drifts.append(Drift(known.camera, "not in the capture"))
    known_ids = {known.camera for known in calibration.cameras}
    return drifts + [Drift(camera, "not in the calibration") for camera in sorted(set(filmed) - known_ids)]


def picture_of(capture: RecordedCapture, refused: RefusedCapture) -> bytes:
    """A PNG of what a capture was refused for."""
    films = {camera.id: capture.film(camera) for camera in capture.document.cameras}
    shown = [
        (evidence, next(islice(pixel_frames(open_film(films[evidence.camera])), evidence.frame, None), None))
        for evidence in refused.evidence
    ]
    return capture_figure(str(refused), shown)


@dataclass(frozen=True)
class _Seen:
    """What all cameras of a capture see of the reference object."""

    source: str
    edges: Edges
    placements: Floats
    views: dict[int, CameraView]
    recognised: dict[int, Recognised]
    unrecognised: dict[int, str]

    def check(self, tolerance_mm: float) -> None:
        check_placements(self.views, self.recognised, self.edges, self.placements, tolerance_mm, self.source)

    def calibrate(self, parameters: CaptureCalibrationParameters) -> tuple[Floats, list[CalibratedView]]:
        """The poses of the object, and the calibration of each camera that recognises it."""
        poses = object_poses(self.recognised, self.edges, self.placements)
        calibrated = dask.compute(
            *(
                dask.delayed(calibrate_view)(self.recognised[camera], self.edges, poses, parameters, self.source)
                for camera in sorted(self.recognised)
            )
        )
        return poses, list(calibrated)


def _doubts(capture: RecordedCapture, seen: _Seen) -> list[str]:
    places = doubts_about(capture.reference.profile_mm, capture.reference.placements_mm)
    views = [doubt for known in seen.recognised.values() for doubt in known.doubts]
    return [f"{capture.reference_file.name}: {doubt}" for doubt in places] + views


def _see(capture: RecordedCapture, parameters: CaptureCalibrationParameters) -> _Seen:
    edges = edges_of(capture.reference.profile_mm)
    placements = np.array(capture.reference.placements_mm, np.float64)

    def seen(camera: CaptureCamera) -> tuple[CameraView, Recognised | str]:
        view = _view(capture, camera, parameters)
        return view, recognise_view(view, edges, placements)

    every = dask.compute(*(dask.delayed(seen)(camera) for camera in capture.document.cameras))
    return _Seen(
        str(capture.file),
        edges,
        placements,
        {view.camera: view for view, _ in every},
        {view.camera: found for view, found in every if isinstance(found, Recognised)},
        {view.camera: found for view, found in every if isinstance(found, str)},
    )


def _view(capture: RecordedCapture, camera: CaptureCamera, parameters: CaptureCalibrationParameters) -> CameraView:
    film = open_film(capture.film(camera))
    stripes: list[Floats] = []
    lost: list[int] = []
    for number, frame in enumerate(pixel_frames(film)):
        if frame is None:
            lost.append(number)
            stripes.append(np.empty((0, 2)))
            continue
        points = extract_stripe(frame, parameters.extraction)
        stripes.append(np.column_stack([points["i"], points["j"]]))
    return CameraView(camera.id, (film.width, film.height), stripes, mounting_of(camera), tuple(lost))


def _sources(capture: RecordedCapture) -> list[Source]:
    """What the calibration rests on: the two documents, and each film or the frames of one.

    Raises
    ------
    RefusedInput
        Two cameras have one and the same film.
    """
    sources = [_source(file, capture.folder) for file in (capture.file, capture.reference_file)]
    cameras: dict[tuple[str, ...], int] = {}
    for camera in capture.document.cameras:
        film = [_source(file, capture.folder) for file in film_files(capture.film(camera))]
        other = cameras.setdefault(tuple(frame.sha256 for frame in film), camera.id)
        if other != camera.id:
            problem = f"has the same film as camera {other}, expected its own"
            raise RefusedInput(capture.file, problem, field=f"camera {camera.id}")
        sources += film
    return sources


def _source(file: Path, folder: Path) -> Source:
    return Source(name=file.relative_to(folder).as_posix(), sha256=sha256(file.read_bytes()))

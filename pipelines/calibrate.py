"""A calibration from a capture: extract and recognise, camera by camera; locate the object; fit, camera by camera."""

from dataclasses import dataclass
from pathlib import Path

import dask
import numpy as np
from numpy.typing import NDArray

from footscan.calibration.from_capture import (
    CameraView,
    assemble,
    calibrate_view,
    locate,
    recognise_view,
)
from footscan.calibration.recognition import FirstMap
from footscan.calibration.reference import edges_of
from footscan.calibration.selection import ModelTrial
from footscan.frames.film import film_files, open_film, pixel_frames
from footscan.stripe.extract import extract_stripe
from pipelines.captures import RecordedCapture, read_capture
from pipelines.engine.digest import sha256
from pipelines.version import SOFTWARE
from schemas.calibration import Calibration, Source
from schemas.mounting import CaptureCamera, mounting_of
from schemas.parameters.calibration import CaptureCalibrationParameters

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CaptureCalibration:
    """A calibration from a capture, and how it came about."""

    calibration: Calibration
    trials: list[ModelTrial]
    departures_mm: Floats
    """(K, 2) how far, in Y and Z, the object stood from where it was said, as the cameras agree; zeros where that does
    not help."""


def calibrate_capture(folder: Path, parameters: CaptureCalibrationParameters, workers: int) -> CaptureCalibration:
    """The calibration of all cameras of the capture in `folder`, with so many threads.

    Raises
    ------
    RefusedInput
        The capture breaks its format, or the object is not recognised or stood elsewhere than said.
    """
    capture = read_capture(folder)
    edges = edges_of(capture.reference.profile_mm)
    placements = np.array(capture.reference.placements_mm, np.float64)
    source = str(capture.file)

    def recognised(camera: CaptureCamera) -> tuple[CameraView, FirstMap | str]:
        view = _view(capture, camera, parameters)
        return view, recognise_view(view, edges, placements)

    with dask.config.set(scheduler="threads", num_workers=workers):
        seen = dask.compute(*(dask.delayed(recognised)(camera) for camera in capture.document.cameras))
        views = {view.camera: view for view, _ in seen}
        first = {view.camera: found for view, found in seen}
        poses = locate(views, first, edges, placements, parameters.placement_tolerance_mm, source)
        known = {camera: found for camera, found in first.items() if isinstance(found, FirstMap)}
        calibrated = dask.compute(
            *(
                dask.delayed(calibrate_view)(views[camera], known[camera], edges, poses, parameters, source)
                for camera in sorted(known)
            )
        )
    return CaptureCalibration(
        assemble(calibrated, _sources(capture), SOFTWARE),
        [trial for view in calibrated for trial in view.trials],
        poses[:, :2] - placements,
    )


def _view(capture: RecordedCapture, camera: CaptureCamera, parameters: CaptureCalibrationParameters) -> CameraView:
    film = open_film(capture.film(camera))
    stripes: list[Floats] = []
    for frame in pixel_frames(film):
        if frame is None:
            stripes.append(np.empty((0, 2)))
            continue
        points = extract_stripe(frame, parameters.extraction)
        stripes.append(np.column_stack([points["i"], points["j"]]))
    return CameraView(camera.id, (film.width, film.height), stripes, mounting_of(camera))


def _sources(capture: RecordedCapture) -> list[Source]:
    """What the calibration rests on: the two documents, and each film or the frames of one."""
    files = [capture.file, capture.reference_file]
    files += [file for camera in capture.document.cameras for file in film_files(capture.film(camera))]
    root = capture.folder.resolve()
    return [
        Source(name=file.resolve().relative_to(root).as_posix(), sha256=sha256(file.read_bytes())) for file in files
    ]

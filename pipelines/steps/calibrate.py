"""The calibrations of all cameras to one calibration file, with the agreement of each pair of cameras."""

import json
from collections.abc import Mapping
from pathlib import Path

from footscan.calibration.capture.as_arrays import camera_views_of, points_of
from footscan.calibration.capture.from_capture import CalibratedView, assemble
from footscan.calibration.capture.reference import placement_doubts
from pipelines.arrays import unpack
from schemas.calibration import CameraCalibration, Source
from schemas.reference import ReferenceObject


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Assemble the calibration of all cameras, as calibration.json.

    `inputs`: the `reference` object, each camera's `stripe-N`, `recognised-N` and `fit-N`, the `digests` of the files
    by name, and `about`: the names of the files in order, the name of the reference object's file, and the software.
    """
    del parameters, places
    about, digests = json.loads(inputs["about"]), json.loads(inputs["digests"])
    arrays = {name: unpack(inputs[name]) for name in inputs if name.startswith(("stripe-", "recognised-", "fit-"))}
    views = []
    for fit in (arrays[name] for name in arrays if name.startswith("fit-")):
        camera = CameraCalibration.model_validate(json.loads(fit["document"].tobytes())["calibration"])
        views.append(CalibratedView(camera, [], points_of(fit), []))
    reference = ReferenceObject.model_validate_json(inputs["reference"])
    places_doubted = placement_doubts(reference.profile_mm, reference.placements_mm)
    doubts = [f"{about['reference']}: {doubt}" for doubt in places_doubted]
    doubts += [doubt for camera in camera_views_of(arrays).recognised.values() for doubt in camera.doubts]
    sources = [Source(name=name, sha256=digests[name]) for name in about["files"]]
    calibration = assemble(views, sources, about["software"], doubts)
    return (calibration.model_dump_json(indent=2) + "\n").encode()

"""The recognised edges and poses of the reference object to the calibration of one camera."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from footscan.calibration.capture.as_arrays import points_arrays, seen_by
from footscan.calibration.capture.from_capture import calibrate_view
from footscan.calibration.capture.reference import edges_of
from footscan.calibration.chart.from_chart import of_laser
from pipelines.arrays import pack, unpack
from schemas.base.model import canonical_json
from schemas.parameters.calibration import CalibrationParameters
from schemas.reference import ReferenceObject


def run(inputs: Mapping[str, bytes], parameters: CalibrationParameters, places: Mapping[str, Path]) -> bytes:
    """Fit the calibration of one camera.

    `inputs`: the `reference` object, its `poses`, the `camera` (number of its view, and `laser`: the camera, its laser,
    and how far ahead its plane is), its `stripe`, and `recognised`; `places`: the `capture` document. The result is
    empty if the camera does not recognise the object.
    """
    camera = json.loads(inputs["camera"])
    _, recognised = seen_by(camera["id"], unpack(inputs["stripe"]), unpack(inputs["recognised"]))
    if isinstance(recognised, str):
        return pack()
    edges = edges_of(ReferenceObject.model_validate_json(inputs["reference"]).profile_mm)
    poses = unpack(inputs["poses"])["poses"]
    fitted = calibrate_view(recognised, edges, poses, parameters, str(places["capture"]))
    document = {
        "calibration": of_laser(fitted.calibration, *camera["laser"]).model_dump(mode="json"),
        "trials": [asdict(trial) for trial in fitted.trials],
        "corners": [asdict(corner) for corner in fitted.corners],
    }
    return pack(document=np.frombuffer(canonical_json(document).encode(), np.uint8), **points_arrays(fitted.points))

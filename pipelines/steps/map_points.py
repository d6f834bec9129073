"""Stripe points to world points of one camera."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.cloud.mapping import map_stripe, refuse_other_size
from footscan.frames.travel import travelled
from pipelines.arrays import pack, unpack
from schemas.base.errors import RefusedInput
from schemas.calibration import CameraCalibration
from schemas.frames import FrameManifest
from schemas.parameters.mapping import MappingParameters
from schemas.scan import Travel


def run(inputs: Mapping[str, bytes], parameters: MappingParameters, places: Mapping[str, Path]) -> bytes:
    """Map the stripe points of one camera to world points.

    `inputs`: `stripe`, `manifest`, the camera's `calibration`, and its `travel` or `positions`; `places`: the `film`,
    to name it. The result holds the `points`, and `x_of_frame`: X of each frame, mm, NaN for those that are lost.

    Raises
    ------
    RefusedInput
        A frame has no position, or the frames are not of the size that the calibration is for.
    """
    extracted = unpack(inputs["stripe"])
    camera = CameraCalibration.model_validate_json(inputs["calibration"])
    manifest = FrameManifest.model_validate_json(inputs["manifest"])
    refuse_other_size(camera, manifest.size, places.get("film", f"camera {camera.camera}"))
    frames = len(manifest.frames)
    if "positions" in inputs:
        positions = json.loads(inputs["positions"])
        x_of_frame = np.array(positions["x_mm"], np.float64)  # null becomes NaN
        if len(x_of_frame) < frames or np.isnan(x_of_frame[:frames]).any():
            raise RefusedInput(positions["file"], f"expected a position for each of {frames} frames", field="frame")
    else:
        x_of_frame = travelled(Travel.model_validate_json(inputs["travel"]), frames)
    points = map_stripe(extracted["stripe"], camera, x_of_frame, parameters)
    x_of_frame = x_of_frame[:frames].copy()
    x_of_frame[extracted["lost"]] = np.nan
    return pack(points=points, x_of_frame=x_of_frame)

"""The film of a body to a calibration with the laser planes."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.calibration.travel.body import Body
from footscan.calibration.travel.from_film import CameraTravel, with_laser_planes
from footscan.frames.travel import travelled
from pipelines.arrays import unpack
from schemas.calibration import Calibration
from schemas.frames import FrameManifest
from schemas.scan import Travel


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Find the laser planes of all cameras, as calibration.json.

    `inputs`: the `calibration`, the `body` (vertices and faces), the `heads` of the cameras, and `stripe-N`,
    `manifest-N`, and `travel-N` or `positions-N` of each camera.

    Raises
    ------
    Finding
        The film does not show the body.
    """
    del parameters, places
    shape = unpack(inputs["body"])
    heads = {int(camera): int(head) for camera, head in json.loads(inputs["heads"]).items()}
    films = {}
    for name in inputs:
        if name.startswith("stripe-"):
            camera = int(name.partition("-")[2])
            frames = len(FrameManifest.model_validate_json(inputs[f"manifest-{camera}"]).frames)
            films[camera] = CameraTravel(unpack(inputs[name])["stripe"], _x_of_frame(inputs, camera, frames))
    calibration = Calibration.model_validate_json(inputs["calibration"])
    made, _ = with_laser_planes(calibration, films, heads, Body(shape["vertices"], shape["faces"]))
    return (made.model_dump_json(indent=2) + "\n").encode()


def _x_of_frame(
    inputs: Mapping[str, bytes], camera: int, frames: int
) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    if f"positions-{camera}" in inputs:
        return np.array(json.loads(inputs[f"positions-{camera}"])["x_mm"], np.float64)
    return travelled(Travel.model_validate_json(inputs[f"travel-{camera}"]), frames)

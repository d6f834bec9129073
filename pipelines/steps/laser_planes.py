"""The film of a body to a calibration with the laser planes."""

import json
from collections.abc import Mapping
from pathlib import Path

from footscan.calibration.travel.body import Body
from footscan.calibration.travel.from_film import CameraTravel, with_laser_planes
from footscan.frames.travel import x_of_frames
from pipelines.arrays import unpack
from schemas.calibration import Calibration
from schemas.frames import FrameManifest


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Find the laser planes of all cameras, as calibration.json.

    `inputs`: the `calibration`, the `body` (vertices and faces), the `heads` of the cameras, and `stripe-N`,
    `manifest-N`, and `travel-N` or `positions-N` of each camera.

    Raises
    ------
    Finding
        The film does not show the body.
    RefusedInput
        A frame has no position.
    """
    del parameters, places
    shape = unpack(inputs["body"])
    heads = {int(camera): int(head) for camera, head in json.loads(inputs["heads"]).items()}
    films = {}
    for name in inputs:
        if name.startswith("stripe-"):
            camera = int(name.partition("-")[2])
            frames = len(FrameManifest.model_validate_json(inputs[f"manifest-{camera}"]).frames)
            x = x_of_frames(inputs.get(f"travel-{camera}"), inputs.get(f"positions-{camera}"), frames)
            films[camera] = CameraTravel(unpack(inputs[name])["stripe"], x)
    calibration = Calibration.model_validate_json(inputs["calibration"])
    made, _ = with_laser_planes(calibration, films, heads, Body(shape["vertices"], shape["faces"]))
    return (made.model_dump_json(indent=2) + "\n").encode()

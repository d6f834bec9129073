"""Stripe points to world points of one camera."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.cloud.mapping import map_stripe, refuse_other_size
from footscan.cloud.points import joined
from footscan.frames.travel import x_of_frames
from pipelines.arrays import pack, unpack
from schemas.calibration import maps_from_json
from schemas.frames import FrameManifest
from schemas.parameters.mapping import MappingParameters


def run(inputs: Mapping[str, bytes], parameters: MappingParameters, places: Mapping[str, Path]) -> bytes:
    """Map the stripe points of one camera to world points.

    `inputs`: `stripe`, `manifest`, the camera's maps as `calibration`, and its `travel` or `positions`; `places`: the
    `film`, to name it. The result holds the `points`, those of each map, and `x_of_frame`: X of the head in each frame,
    mm, NaN for those that are lost.

    Raises
    ------
    RefusedInput
        A frame has no position, or the frames are not of the size that the calibration is for.
    """
    extracted = unpack(inputs["stripe"])
    maps = maps_from_json(inputs["calibration"])
    manifest = FrameManifest.model_validate_json(inputs["manifest"])
    for camera in maps:
        refuse_other_size(camera, manifest.size, places.get("film", f"camera {camera.camera}"))
    frames = len(manifest.frames)
    x_of_frame = x_of_frames(inputs.get("travel"), inputs.get("positions"), frames)
    points = joined(map_stripe(extracted["stripe"], camera, x_of_frame, parameters) for camera in maps)
    x_of_frame = x_of_frame[:frames].copy()
    x_of_frame[extracted["lost"]] = np.nan
    return pack(points=points, x_of_frame=x_of_frame)

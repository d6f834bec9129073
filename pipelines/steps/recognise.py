"""The stripe of one camera to the edges of the reference object, or the reason why they are not recognised."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.calibration.capture.as_arrays import mounting_of_signs, recognised_arrays, view_of
from footscan.calibration.capture.from_capture import recognise_view
from footscan.calibration.capture.reference import edges_of
from pipelines.arrays import pack, unpack
from schemas.reference import ReferenceObject


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Recognise the edges of the reference object in the stripe of one camera.

    `inputs`: `stripe`, the `reference` object, and the `camera` with its number and the side it stands on.
    """
    del parameters, places
    reference = ReferenceObject.model_validate_json(inputs["reference"])
    camera = json.loads(inputs["camera"])
    mounting = mounting_of_signs(camera["mounting"])
    view = view_of(camera["id"], unpack(inputs["stripe"]), mounting)
    placements = np.array(reference.placements_mm, np.float64)
    recognised = recognise_view(view, edges_of(reference.profile_mm), placements)
    return pack(**recognised_arrays(recognised, mounting))

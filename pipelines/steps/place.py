"""The recognised edges of all cameras to the poses in which the reference object stood."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from footscan.calibration.capture.as_arrays import camera_views_of
from footscan.calibration.capture.from_capture import object_poses
from footscan.calibration.capture.reference import edges_of
from footscan.calibration.capture.refused_capture import check_placements, refuse_unrecognised
from pipelines.arrays import pack, unpack
from schemas.parameters.calibration import PlacementParameters
from schemas.reference import ReferenceObject


def run(inputs: Mapping[str, bytes], parameters: PlacementParameters, places: Mapping[str, Path]) -> bytes:
    """Find the poses of the reference object in the views of all cameras.

    `inputs`: the `reference` object, each camera's `stripe-N` and `recognised-N`; `places`: the `capture` document.

    Raises
    ------
    RefusedCapture
        The object was wrongly placed, or no camera recognises it.
    """
    reference = ReferenceObject.model_validate_json(inputs["reference"])
    camera_views = camera_views_of({name: unpack(data) for name, data in inputs.items() if name != "reference"})
    edges, placements = edges_of(reference.profile_mm), np.array(reference.placements_mm, np.float64)
    source, tolerance_mm = str(places["capture"]), parameters.placement_tolerance_mm
    check_placements(camera_views.views, camera_views.recognised, edges, placements, tolerance_mm, source)
    if not camera_views.recognised:
        refuse_unrecognised(camera_views.views, camera_views.unrecognised, source)
    return pack(poses=object_poses(camera_views.recognised, edges, placements))

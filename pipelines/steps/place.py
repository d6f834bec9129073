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
    """`inputs`: the `reference` object, each camera's `stripe-N` and `recognised-N`; `places`: the `capture` document.

    Raises
    ------
    RefusedCapture
        The object was wrongly placed, or no camera recognises it.
    """
    reference = ReferenceObject.model_validate_json(inputs["reference"])
    seen = camera_views_of({name: unpack(data) for name, data in inputs.items() if name != "reference"})
    edges, placements = edges_of(reference.profile_mm), np.array(reference.placements_mm, np.float64)
    source = str(places["capture"])
    check_placements(seen.views, seen.recognised, edges, placements, parameters.placement_tolerance_mm, source)
    if not seen.recognised:
        refuse_unrecognised(seen.views, seen.unrecognised, source)
    return pack(poses=object_poses(seen.recognised, edges, placements))

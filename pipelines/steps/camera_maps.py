"""A calibration reduced to the maps of some cameras."""

import json
from collections.abc import Mapping
from pathlib import Path

from schemas.base.model import canonical_json
from schemas.calibration import Calibration


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Return the calibration with the maps of the `cameras` only, as JSON.

    `inputs`: the `calibration`, and the numbers of the `cameras`.
    """
    del parameters, places
    calibration, kept = Calibration.model_validate_json(inputs["calibration"]), json.loads(inputs["cameras"])
    maps = [camera for camera in calibration.cameras if camera.camera in kept]
    return canonical_json(calibration.model_copy(update={"cameras": maps}).model_dump(mode="json")).encode()

"""A calibration to the maps of one camera."""

import json
from collections.abc import Mapping
from pathlib import Path

from schemas.calibration import Calibration, maps_to_json


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Return the map of one camera, or the maps of one that sees two lasers, as JSON.

    `inputs`: the `calibration`, and the number of the `camera`.
    """
    del parameters, places
    calibration = Calibration.model_validate_json(inputs["calibration"])
    return maps_to_json(calibration.maps(json.loads(inputs["camera"]))).encode()

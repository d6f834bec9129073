"""A calibration to the map of one camera."""

import json
from collections.abc import Mapping
from pathlib import Path

from schemas.base.model import canonical_json
from schemas.calibration import Calibration


def run(inputs: Mapping[str, bytes], parameters: None, places: Mapping[str, Path]) -> bytes:
    """Return the map of one camera, as JSON.

    `inputs`: the `calibration`, and the number of the `camera`.
    """
    del parameters, places
    calibration = Calibration.model_validate_json(inputs["calibration"])
    return canonical_json(calibration.camera(json.loads(inputs["camera"])).model_dump(mode="json")).encode()
